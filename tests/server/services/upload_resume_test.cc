// Uploads that are interrupted and resumed.
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/store/layout.h"
#include "tests/server/service_test.h"

namespace pepeseg {
namespace {

struct UploadResumeTest : EmptyScene {
  UploadResumeTest() : EmptyScene(PEPESEG_FAKE_WORKER) {
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
  void WriteUpTo(size_t end) { EXPECT_ERROR(running.Write(Parts(0, end)), grpc::INVALID_ARGUMENT); }
  int64_t Committed() {
    const v1::Upload now = running.GetUpload(upload);
    EXPECT_EQ(now.missing_files_size(), 1);
    return now.partial_files().empty() ? 0 : now.partial_files(0).committed_bytes();
  }

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
  ASSERT_OK(running.Write(Parts(3'000'000), &response));
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
    const auto partial = PartialFolderOf(running.options.data, {{1, "default", "shelf"}, 1}) /
                         Declare(file).sha256();
    ASSERT_TRUE(Eventually([&] {
      std::error_code error;
      return std::filesystem::file_size(partial, error) >= 4'000'000 && !error;
    }));
    EXPECT_EQ(Committed(), 0) << "before 32 MiB";
    context.TryCancel();
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  EXPECT_TRUE(Eventually([&] { return Committed() > 0; }, absl::Seconds(20)));
  EXPECT_EQ(Committed(), 4'000'000);
  grpc::Status status;
  EXPECT_TRUE(Eventually([&] {
    status = running.Write(Parts(4'000'000));
    return status.error_code() != grpc::ABORTED;
  }));
  EXPECT_OK(status);
}

TEST_F(UploadResumeTest, ReportsTheCommittedOffset) {
  WriteUpTo(3'000'000);
  for (const int64_t offset : {2'999'999, 4'000'000, -1}) {
    const grpc::Status status =
        running.Write({HeaderPart(upload, file.path, offset), ChunkPart("x"), EndPart()});
    EXPECT_ERROR(status, grpc::OUT_OF_RANGE,
                 {.reason = "WRONG_OFFSET",
                  .resource = file.path,
                  .value = absl::StrCat(offset),
                  .limit = "3000000"});
  }
  EXPECT_EQ(Committed(), 3'000'000);
}

TEST_F(UploadResumeTest, AllowsOneWriterAtATime) {
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(upload, file.path)));
  ASSERT_TRUE(Eventually([&] { return running.CountPartialFiles() > 0; }));
  const grpc::Status second = running.Write(Parts(0));
  EXPECT_ERROR(second, grpc::ABORTED, {.reason = "FILE_BUSY"});
  EXPECT_TRUE(DetailOf(second).has_retry_after());
  const auto parts = Parts(0);
  for (size_t i = 1; i < parts.size(); ++i) ASSERT_TRUE(stream->Write(parts[i]));
  stream->WritesDone();
  EXPECT_OK(stream->Finish());
}

// Partial bytes that do not match the declared digest are detected at the end and removed.
TEST_F(UploadResumeTest, DropsAWrongPartialUpload) {
  auto parts = Parts(0, 2'000'000);
  parts[1] = ChunkPart(std::string(1 << 20, 'x'));
  EXPECT_FALSE(running.Write(parts).ok());
  ASSERT_EQ(Committed(), 2'000'000);
  EXPECT_ERROR(running.Write(Parts(2'000'000)), grpc::DATA_LOSS);
  EXPECT_EQ(Committed(), 0);
  EXPECT_OK(running.Write(Parts(0)));
}

TEST_F(UploadResumeTest, RefusesFilesThatDoNotFitBeforeTheyAreSent) {
  const auto space = std::filesystem::space(running.options.data);
  constexpr int64_t kMostInAll = int64_t{256} << 30;
  if (static_cast<int64_t>(space.available) >= kMostInAll) GTEST_SKIP() << "the disk is too large";
  v1::CreateUploadRequest request = Under{"scenes/shelf"};
  for (int i = 0; i < 64; ++i) {
    v1::FileDeclaration declaration = Declare({absl::StrCat("images/", i), absl::StrCat(i)});
    declaration.set_size(int64_t{4} << 30);
    *request.add_files() = declaration;
  }
  const grpc::Status status = Call(&DatasetStub::CreateUpload, request);
  EXPECT_ERROR(status, grpc::RESOURCE_EXHAUSTED,
               {.reason = "DISK_FULL", .value = absl::StrCat(kMostInAll)});
  EXPECT_FALSE(DetailOf(status).limit().empty());
  EXPECT_EQ(running.CreateUpload("shelf", {file}).name(), "scenes/shelf/uploads/2")
      << "nothing was made of the other";
}

}  // namespace
}  // namespace pepeseg
