// Uploads that are interrupted and resumed.
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/layout.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

struct UploadResumeTest : ::testing::Test {
  UploadResumeTest() : running(PEPESEG_FAKE_WORKER) {
    running.CreateScene("shelf");
    for (size_t i = 0; i < file.bytes.size(); ++i) {
      file.bytes[i] = static_cast<char>(i * 2654435761u >> 13);
    }
    upload = running.CreateUpload("shelf", {file}).name();
  }

  // Returns the messages for the bytes from `offset` to `end`, with the end of the file if it is
  // there.
  std::vector<v1::WriteFilesRequest> Parts(int64_t offset, size_t end = std::string::npos) const {
    std::vector<v1::WriteFilesRequest> parts = {HeaderPart(upload, file.path, offset)};
    end = std::min(end, file.bytes.size());
    for (size_t at = offset; at < end; at += 1 << 20) {
      parts.push_back(ChunkPart(file.bytes.substr(at, std::min<size_t>(1 << 20, end - at))));
    }
    if (end == file.bytes.size()) parts.push_back(EndPart());
    return parts;
  }
  // Sends a part of the file on a stream that ends in the middle of it.
  void WriteUpTo(size_t end) {
    EXPECT_EQ(running.Write(Parts(0, end)).error_code(), grpc::INVALID_ARGUMENT);
  }
  int64_t Committed() {
    const v1::Upload now = running.GetUpload(upload);
    EXPECT_EQ(now.missing_files_size(), 1);
    return now.partial_files().empty() ? 0 : now.partial_files(0).committed_bytes();
  }

  RunningServer running;
  TestFile file{"images/1.jpg", std::string(5'000'000, '\0')};
  std::string upload;
};

TEST_F(UploadResumeTest, ResumesWhereTheStreamEnded) {
  EXPECT_EQ(Committed(), 0);
  WriteUpTo(3'000'000);
  ASSERT_EQ(Committed(), 3'000'000);
  EXPECT_EQ(running.GetUpload(upload).partial_files(0).path(), file.path);
  running.Restart();
  ASSERT_EQ(Committed(), 3'000'000);
  v1::WriteFilesResponse response;
  const grpc::Status status = running.Write(Parts(3'000'000), &response);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.num_bytes(), 2'000'000) << "of this stream";
  EXPECT_EQ(running.GetUpload(upload).missing_files_size(), 0);
  EXPECT_EQ(running.CountPartialFiles(), 0);
}

TEST_F(UploadResumeTest, KeepsWhatCameBeforeACallWasCutOff) {
  {
    grpc::ClientContext context;
    v1::WriteFilesResponse response;
    const auto stream = running.datasets->WriteFiles(&context, &response);
    for (const auto& part : Parts(0, 4'000'000)) ASSERT_TRUE(stream->Write(part));
    const auto partial =
        PartialFolderOf(running.options.data, {"default", "shelf", 1}) / Declare(file).sha256();
    std::error_code error;
    while (std::filesystem::file_size(partial, error) < 4'000'000 || error) {
      absl::SleepFor(absl::Milliseconds(2));
    }
    EXPECT_EQ(Committed(), 0) << "before 32 MiB";
    context.TryCancel();
    EXPECT_EQ(stream->Finish().error_code(), grpc::CANCELLED);
  }
  const absl::Time deadline = absl::Now() + absl::Seconds(20);
  while (Committed() == 0 && absl::Now() < deadline) absl::SleepFor(absl::Milliseconds(2));
  EXPECT_EQ(Committed(), 4'000'000);
  grpc::Status status = running.Write(Parts(4'000'000));
  while (status.error_code() == grpc::ABORTED) status = running.Write(Parts(4'000'000));
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(UploadResumeTest, ReportsTheCommittedOffset) {
  WriteUpTo(3'000'000);
  for (const int64_t offset : {2'999'999, 4'000'000, -1}) {
    const grpc::Status status =
        running.Write({HeaderPart(upload, file.path, offset), ChunkPart("x"), EndPart()});
    EXPECT_EQ(status.error_code(), grpc::OUT_OF_RANGE) << status.error_message();
    EXPECT_EQ(DetailOf(status).reason(), "WRONG_OFFSET");
    EXPECT_EQ(DetailOf(status).value(), absl::StrCat(offset));
    EXPECT_EQ(DetailOf(status).limit(), "3000000");
    EXPECT_EQ(DetailOf(status).resource(), file.path);
  }
  EXPECT_EQ(Committed(), 3'000'000);
}

TEST_F(UploadResumeTest, AllowsOneWriterAtATime) {
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(upload, file.path)));
  while (running.CountPartialFiles() == 0) absl::SleepFor(absl::Milliseconds(2));
  const grpc::Status second = running.Write(Parts(0));
  EXPECT_EQ(second.error_code(), grpc::ABORTED) << second.error_message();
  EXPECT_EQ(DetailOf(second).reason(), "FILE_BUSY");
  EXPECT_TRUE(DetailOf(second).has_retry_after());
  const auto parts = Parts(0);
  for (size_t i = 1; i < parts.size(); ++i) ASSERT_TRUE(stream->Write(parts[i]));
  stream->WritesDone();
  const grpc::Status first = stream->Finish();
  EXPECT_TRUE(first.ok()) << first.error_message();
}

// Partial bytes that do not match the declared digest are detected at the end and removed.
TEST_F(UploadResumeTest, DropsAWrongPartialUpload) {
  auto parts = Parts(0, 2'000'000);
  parts[1] = ChunkPart(std::string(1 << 20, 'x'));
  EXPECT_FALSE(running.Write(parts).ok());
  ASSERT_EQ(Committed(), 2'000'000);
  EXPECT_EQ(running.Write(Parts(2'000'000)).error_code(), grpc::DATA_LOSS);
  EXPECT_EQ(Committed(), 0);
  EXPECT_TRUE(running.Write(Parts(0)).ok());
}

TEST_F(UploadResumeTest, RefusesFilesThatDoNotFitBeforeTheyAreSent) {
  const auto space = std::filesystem::space(running.options.data);
  constexpr int64_t kMostInAll = int64_t{256} << 30;
  if (static_cast<int64_t>(space.available) >= kMostInAll) GTEST_SKIP() << "the disk is too large";
  v1::CreateUploadRequest request;
  request.set_parent("scenes/shelf");
  for (int i = 0; i < 64; ++i) {
    v1::FileDeclaration declaration = Declare({absl::StrCat("images/", i), absl::StrCat(i)});
    declaration.set_size(int64_t{4} << 30);
    *request.add_files() = declaration;
  }
  grpc::ClientContext context;
  v1::Upload refused;
  const grpc::Status status = running.datasets->CreateUpload(&context, request, &refused);
  EXPECT_EQ(status.error_code(), grpc::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_EQ(DetailOf(status).reason(), "DISK_FULL");
  EXPECT_EQ(DetailOf(status).value(), absl::StrCat(kMostInAll));
  EXPECT_FALSE(DetailOf(status).limit().empty());
  EXPECT_EQ(running.CreateUpload("shelf", {file}).name(), "scenes/shelf/uploads/2")
      << "nothing was made of the other";
}

}  // namespace
}  // namespace pepeseg
