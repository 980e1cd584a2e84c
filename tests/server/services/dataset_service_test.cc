#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/store/layout.h"
#include "tests/server/running_server.h"

namespace pepeseg {
namespace {

std::string ManyBytes(size_t size, unsigned seed) {
  std::string bytes(size, '\0');
  for (char& byte : bytes) {
    seed = seed * 1664525u + 1013904223u;
    byte = static_cast<char>(seed >> 24);
  }
  return bytes;
}

struct DatasetServiceTest : ::testing::Test {
  DatasetServiceTest() : running(PEPESEG_FAKE_WORKER) { running.CreateScene("shelf"); }

  grpc::Status Create(const std::vector<v1::FileDeclaration>& files,
                      const std::string& request_id = "") {
    grpc::ClientContext context;
    v1::CreateUploadRequest request;
    request.set_parent("scenes/shelf");
    request.mutable_files()->Add(files.begin(), files.end());
    request.set_request_id(request_id);
    return running.datasets->CreateUpload(&context, request, &upload);
  }
  grpc::Status Seal(const std::string& name) {
    grpc::ClientContext context;
    v1::SealUploadRequest request;
    request.set_name(name);
    return running.datasets->SealUpload(&context, request, &dataset);
  }
  // Expects that a stream of these parts fails, keeps nothing, and that a correct one works after
  // it.
  void ExpectWriteFails(const std::vector<v1::WriteFilesRequest>& parts, grpc::StatusCode code,
                        const std::string& words) {
    const grpc::Status status = running.Write(parts);
    EXPECT_EQ(status.error_code(), code) << status.error_message();
    EXPECT_NE(status.error_message().find(words), std::string::npos) << status.error_message();
    EXPECT_EQ(running.CountBlobFiles(), 0);
    EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 1);
  }

  RunningServer running;
  v1::Upload upload;
  v1::Dataset dataset;
};

TEST_F(DatasetServiceTest, TakesFilesAndSeals) {
  const std::vector<TestFile> files = {{"images/1.jpg", ManyBytes(3'500'000, 1)},
                                       {"images/2.jpg", "x"},
                                       {"sparse/0/cameras.bin", "cameras", v1::FILE_KIND_POSES}};
  ASSERT_TRUE(Create({Declare(files[0]), Declare(files[1]), Declare(files[2])}).ok());
  EXPECT_EQ(upload.name(), "scenes/shelf/uploads/1");
  EXPECT_EQ(upload.missing_files_size(), 3);
  EXPECT_EQ(upload.num_bytes(), 3'500'008);
  std::vector<v1::WriteFilesRequest> parts;
  for (const TestFile& file : files) {
    for (auto& part : FileParts(upload.name(), file)) parts.push_back(std::move(part));
  }
  v1::WriteFilesResponse response;
  const grpc::Status written = running.Write(parts, &response);
  ASSERT_TRUE(written.ok()) << written.error_message();
  EXPECT_EQ(response.num_files(), 3);
  EXPECT_EQ(response.num_bytes(), 3'500'008);
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 0);
  ASSERT_TRUE(Seal(upload.name()).ok());
  EXPECT_EQ(dataset.name(), "scenes/shelf/datasets/1");
  EXPECT_EQ(dataset.num_files(), 3);
  EXPECT_TRUE(dataset.has_seal_time());
  EXPECT_TRUE(running.GetUpload(upload.name()).sealed());
  EXPECT_TRUE(Seal(upload.name()).ok()) << "twice is no error";

  const auto blob = BlobPath(running.options.data, {"default", Declare(files[0]).sha256()});
  std::ostringstream stored;
  stored << std::ifstream(blob, std::ios::binary).rdbuf();
  EXPECT_EQ(stored.str(), files[0].bytes);
  std::ifstream file(DatasetManifestPath(running.options.data, "shelf", 1));
  const auto manifest = nlohmann::json::parse(file);
  EXPECT_EQ(manifest["files"].size(), 3u);
  EXPECT_EQ(manifest["files"][2]["path"], "sparse/0/cameras.bin");
  EXPECT_EQ(manifest["files"][2]["kind"], "FILE_KIND_POSES");
}

TEST_F(DatasetServiceTest, AdvisesMasksIfADatasetHasNone) {
  const auto advice = [this](const std::vector<TestFile>& files) {
    running.UploadAndSeal("shelf", files);
    grpc::ClientContext context;
    v1::ListDatasetsRequest request;
    request.set_parent("scenes/shelf");
    v1::ListDatasetsResponse all;
    EXPECT_TRUE(running.datasets->ListDatasets(&context, request, &all).ok());
    return all.datasets(all.datasets_size() - 1).advice();
  };
  const TestFile photograph{"images/1.jpg", "x"};
  const TestFile mask{"masks/1.png", "y", v1::FILE_KIND_MASK};
  EXPECT_TRUE(advice({photograph, mask}).empty());
  const auto without = advice({photograph});
  ASSERT_EQ(without.size(), 1);
  EXPECT_NE(without[0].find("pepeseg-priors"), std::string::npos) << without[0];
  ASSERT_TRUE(Seal("scenes/shelf/uploads/2").ok());
  EXPECT_EQ(dataset.advice_size(), 1);

  running.options.workers.priors_command = "/bin/true";
  running.Restart();
  EXPECT_TRUE(advice({photograph}).empty()) << "the server makes masks by its command";
}

TEST_F(DatasetServiceTest, SeparatesFoldersOfScenesThatDifferInCase) {
  const std::vector<TestFile> files = {{"images/1.jpg", "one"}};
  for (const char* scene : {"fern_2", "Fern_2", "FERN.2"}) {
    running.CreateScene(scene);
    running.UploadAndSeal(scene, files);
  }
  std::set<std::string> folders;
  for (const auto& entry :
       std::filesystem::directory_iterator(DatasetsFolder(running.options.data))) {
    folders.insert(absl::AsciiStrToLower(entry.path().filename().string()));
    EXPECT_TRUE(std::filesystem::exists(entry.path() / "1.json"));
  }
  EXPECT_EQ(folders.size(), 3u);
}

TEST_F(DatasetServiceTest, TakesAFileAgainAfterAStreamWasCut) {
  const TestFile one{"images/1.jpg", ManyBytes(100'000, 1)};
  const TestFile two{"images/2.jpg", ManyBytes(3'000'000, 2)};
  ASSERT_TRUE(Create({Declare(one), Declare(two)}).ok());
  {
    grpc::ClientContext context;
    v1::WriteFilesResponse response;
    const auto stream = running.datasets->WriteFiles(&context, &response);
    for (const auto& part : FileParts(upload.name(), one)) ASSERT_TRUE(stream->Write(part));
    ASSERT_TRUE(stream->Write(HeaderPart(upload.name(), two.path)));
    ASSERT_TRUE(stream->Write(ChunkPart(two.bytes.substr(0, 1'000'000))));
    // Waits until the server is in the middle of the second file.
    while (running.CountPartialFiles() < 2) absl::SleepFor(absl::Milliseconds(5));
    context.TryCancel();
    EXPECT_EQ(stream->Finish().error_code(), grpc::CANCELLED);
  }
  // The complete file is committed when the stream ends.
  const absl::Time deadline = absl::Now() + absl::Seconds(20);
  while (running.CountBlobFiles() == 0 && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(5));
  }
  EXPECT_EQ(running.CountBlobFiles(), 1);
  const v1::Upload after = running.GetUpload(upload.name());
  ASSERT_EQ(after.missing_files_size(), 1);
  EXPECT_EQ(after.missing_files(0), two.path);
  // Sent from its start, although a part is there; works once the first stream has released it.
  grpc::Status status = running.Write(FileParts(upload.name(), two));
  while (status.error_code() == grpc::ABORTED) {
    absl::SleepFor(absl::Milliseconds(5));
    status = running.Write(FileParts(upload.name(), two));
  }
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(running.CountPartialFiles(), 0);
  EXPECT_TRUE(Seal(upload.name()).ok());
}

TEST_F(DatasetServiceTest, RefusesWrongBytesAndKeepsNothing) {
  const TestFile good{"images/1.jpg", "0123456789"};
  ASSERT_TRUE(Create({Declare(good)}).ok());
  const std::string name = upload.name();
  const auto header = HeaderPart(name, good.path);

  auto damaged = ChunkPart(good.bytes);
  damaged.mutable_chunk()->mutable_data()->at(3) ^= 1;
  ExpectWriteFails({header, damaged, EndPart()}, grpc::DATA_LOSS,
                   "images/1.jpg: the chunk at byte 0");
  ExpectWriteFails({header, ChunkPart("012345678X"), EndPart()}, grpc::DATA_LOSS, "SHA-256");
  ExpectWriteFails({header, ChunkPart("01234"), EndPart()}, grpc::INVALID_ARGUMENT,
                   "images/1.jpg: ended after 5 of the 10 bytes declared");
  ExpectWriteFails({header, ChunkPart("01234"), ChunkPart("567890"), EndPart()},
                   grpc::INVALID_ARGUMENT, "more bytes than the 10 declared");
  ExpectWriteFails({header, ChunkPart(good.bytes)}, grpc::INVALID_ARGUMENT,
                   "images/1.jpg: the stream ended before its end");
  EXPECT_TRUE(running.Write(FileParts(name, good)).ok());
}

TEST_F(DatasetServiceTest, RefusesMessagesOutOfOrder) {
  const TestFile good{"images/1.jpg", "0123456789"};
  ASSERT_TRUE(Create({Declare(good)}).ok());
  const std::string name = upload.name();
  const auto header = HeaderPart(name, good.path);
  ExpectWriteFails({ChunkPart("x")}, grpc::INVALID_ARGUMENT, "where a header must be");
  ExpectWriteFails({EndPart()}, grpc::INVALID_ARGUMENT, "where a header must be");
  ExpectWriteFails({v1::WriteFilesRequest()}, grpc::INVALID_ARGUMENT, "where a header must be");
  ExpectWriteFails({header, header}, grpc::INVALID_ARGUMENT, "no end before the next header");
  ExpectWriteFails({header, ChunkPart("")}, grpc::INVALID_ARGUMENT, "a chunk of 0 bytes");
  ExpectWriteFails({header, ChunkPart(std::string((4 << 20) + 1, 'x'))}, grpc::INVALID_ARGUMENT,
                   "a chunk of 4194305 bytes");
  ExpectWriteFails({HeaderPart(name, "images/2.jpg")}, grpc::NOT_FOUND, "images/2.jpg");
  ExpectWriteFails({HeaderPart(name, "../../x")}, grpc::NOT_FOUND, "../../x");
  ExpectWriteFails({HeaderPart("scenes/shelf/uploads/9", good.path)}, grpc::NOT_FOUND, "9");
  ExpectWriteFails({HeaderPart("../uploads/9", good.path)}, grpc::INVALID_ARGUMENT,
                   "header.upload");
}

TEST_F(DatasetServiceTest, RefusesBadDeclarations) {
  TestFile file{"../../x", "bytes"};
  grpc::Status status = Create({Declare({"ok", "a"}), Declare(file)});
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(status).field(), "files[1].path");
  EXPECT_EQ(DetailOf(status).value(), "../../x");
  file.path = "x";
  auto declaration = Declare(file);
  declaration.set_size(-5);
  EXPECT_EQ(DetailOf(Create({declaration})).field(), "files[0].size");
  declaration = Declare(file);
  declaration.set_sha256("beef");
  EXPECT_EQ(DetailOf(Create({declaration})).field(), "files[0].sha256");
  EXPECT_EQ(DetailOf(Create({})).field(), "files");
  // These have created nothing.
  grpc::ClientContext context;
  v1::GetUploadRequest request;
  request.set_name("scenes/shelf/uploads/1");
  EXPECT_EQ(running.datasets->GetUpload(&context, request, &upload).error_code(), grpc::NOT_FOUND);
}

TEST_F(DatasetServiceTest, SealsOnlyCompleteUploads) {
  const TestFile one{"images/1.jpg", "one"};
  const TestFile two{"images/2.jpg", "two"};
  ASSERT_TRUE(Create({Declare(one), Declare(two)}).ok());
  ASSERT_TRUE(running.Write(FileParts(upload.name(), one)).ok());
  const grpc::Status status = Seal(upload.name());
  EXPECT_EQ(status.error_code(), grpc::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("images/2.jpg"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(DatasetManifestPath(running.options.data, "shelf", 1)));
  ASSERT_TRUE(running.Write(FileParts(upload.name(), two)).ok());
  ASSERT_TRUE(Seal(upload.name()).ok());
  const grpc::Status late = running.Write(FileParts(upload.name(), two));
  EXPECT_EQ(late.error_code(), grpc::FAILED_PRECONDITION) << late.error_message();
}

TEST_F(DatasetServiceTest, DoesNotAskForStoredBytesAgain) {
  const TestFile one{"images/1.jpg", "the same"};
  const TestFile two{"copies/1.jpg", "the same"};
  ASSERT_TRUE(Create({Declare(one), Declare(two)}).ok());
  ASSERT_TRUE(running.Write(FileParts(upload.name(), one)).ok());
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 0);
  EXPECT_TRUE(Seal(upload.name()).ok());
  ASSERT_TRUE(Create({Declare(two)}).ok());
  EXPECT_EQ(upload.name(), "scenes/shelf/uploads/2");
  EXPECT_EQ(upload.missing_files_size(), 0);
  EXPECT_TRUE(Seal(upload.name()).ok());
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(DatasetServiceTest, AcceptsTheSameDigestTwiceInAGroup) {
  const std::vector<TestFile> files = {
      {"a.jpg", "the same"}, {"b.jpg", "other"}, {"c.jpg", "the same"}};
  ASSERT_TRUE(Create({Declare(files[0]), Declare(files[1]), Declare(files[2])}).ok());
  std::vector<v1::WriteFilesRequest> parts;
  for (const TestFile& file : files) {
    for (auto& part : FileParts(upload.name(), file)) parts.push_back(std::move(part));
  }
  v1::WriteFilesResponse response;
  const grpc::Status written = running.Write(parts, &response);
  ASSERT_TRUE(written.ok()) << written.error_message();
  EXPECT_EQ(response.num_files(), 3);
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 0);
  EXPECT_TRUE(Seal(upload.name()).ok());
}

// Files that were complete before an error are stored, whatever the error.
TEST_F(DatasetServiceTest, KeepsTheGroupBeforeAnError) {
  std::vector<v1::FileDeclaration> declarations;
  std::vector<v1::WriteFilesRequest> parts;
  constexpr int kFiles = 40;
  for (int i = 0; i < kFiles; ++i) {
    const TestFile file{absl::StrCat("images/", 100 + i), absl::StrCat("bytes ", i)};
    declarations.push_back(Declare(file));
    for (auto& part : FileParts("scenes/shelf/uploads/1", file)) parts.push_back(std::move(part));
  }
  parts[parts.size() - 2] = ChunkPart("wrong");
  ASSERT_TRUE(Create(declarations).ok());
  const grpc::Status status = running.Write(parts);
  EXPECT_EQ(status.error_code(), grpc::INVALID_ARGUMENT) << status.error_message();
  ASSERT_EQ(running.GetUpload(upload.name()).missing_files_size(), 1);
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files(0), absl::StrCat("images/", 139));
}

TEST_F(DatasetServiceTest, KeepsNothingOfADeletedUpload) {
  const TestFile file{"images/1.jpg", ManyBytes(3'000'000, 2)};
  ASSERT_TRUE(Create({Declare(file)}).ok());
  grpc::ClientContext context, deletion;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(upload.name(), file.path)));
  ASSERT_TRUE(stream->Write(ChunkPart(file.bytes.substr(0, 1'000'000))));
  while (running.CountPartialFiles() < 1) absl::SleepFor(absl::Milliseconds(5));
  v1::DeleteSceneRequest request;
  request.set_name("scenes/shelf");
  google::protobuf::Empty empty;
  ASSERT_TRUE(running.scenes->DeleteScene(&deletion, request, &empty).ok());
  stream->WritesDone();
  EXPECT_FALSE(stream->Finish().ok());
  EXPECT_EQ(running.CountPartialFiles(), 0);
}

TEST_F(DatasetServiceTest, RemovesPartialFilesOfDeletedScenes) {
  const TestFile file{"images/1.jpg", ManyBytes(3'000'000, 2)};
  ASSERT_TRUE(Create({Declare(file)}).ok());
  EXPECT_FALSE(running.Write({HeaderPart(upload.name(), file.path), ChunkPart("beginning")}).ok());
  ASSERT_GE(running.CountPartialFiles(), 1);
  grpc::ClientContext context;
  v1::DeleteSceneRequest request;
  request.set_name("scenes/shelf");
  google::protobuf::Empty empty;
  ASSERT_TRUE(running.scenes->DeleteScene(&context, request, &empty).ok());
  EXPECT_EQ(running.CountPartialFiles(), 0);
}

TEST_F(DatasetServiceTest, ReturnsTheSameUploadToARetry) {
  const TestFile one{"images/1.jpg", "one"};
  ASSERT_TRUE(Create({Declare(one)}, "r1").ok());
  ASSERT_TRUE(Create({Declare(one)}, "r1").ok());
  EXPECT_EQ(upload.name(), "scenes/shelf/uploads/1");
  const grpc::Status other = Create({Declare({"images/2.jpg", "two"})}, "r1");
  EXPECT_EQ(other.error_code(), grpc::ALREADY_EXISTS);
}

TEST_F(DatasetServiceTest, TakesManyStreamsAtOnce) {
  std::vector<TestFile> files;
  std::vector<v1::FileDeclaration> declarations;
  for (int i = 0; i < 24; ++i) {
    files.push_back({"images/" + std::to_string(i), ManyBytes(200'000 + 1000 * i, i)});
    declarations.push_back(Declare(files.back()));
  }
  ASSERT_TRUE(Create(declarations).ok());
  std::atomic<int> written = 0;
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = t; i < 24; i += 8) {
        grpc::Status status = running.Write(FileParts(upload.name(), files[i], 64'000));
        while (status.error_code() == grpc::ABORTED) {
          status = running.Write(FileParts(upload.name(), files[i], 64'000));
        }
        written += status.ok() ? 1 : 0;
        // A stream that sends a file which another stream writes is refused, without harm.
        running.Write(FileParts(upload.name(), files[(i + 1) % 24], 64'000));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(written, 24);
  EXPECT_TRUE(Seal(upload.name()).ok());
  EXPECT_EQ(running.CountBlobFiles(), 24);
}

TEST_F(DatasetServiceTest, ListsSealedDatasets) {
  running.UploadAndSeal("shelf", {{"images/1.jpg", "one"}});
  running.CreateUpload("shelf", {{"images/2.jpg", "two"}});
  running.UploadAndSeal("shelf", {{"images/3.jpg", "three"}});
  grpc::ClientContext context;
  v1::ListDatasetsRequest request;
  request.set_parent("scenes/shelf");
  v1::ListDatasetsResponse response;
  ASSERT_TRUE(running.datasets->ListDatasets(&context, request, &response).ok());
  ASSERT_EQ(response.datasets_size(), 2);
  EXPECT_EQ(response.datasets(0).name(), "scenes/shelf/datasets/1");
  EXPECT_EQ(response.datasets(1).name(), "scenes/shelf/datasets/3");
}

TEST_F(DatasetServiceTest, GetsASealedDataset) {
  const std::string name = running.UploadAndSeal("shelf", {{"images/1.jpg", "one"}});
  running.CreateUpload("shelf", {{"images/2.jpg", "two"}});
  const auto get = [&](const std::string& wanted) {
    grpc::ClientContext context;
    v1::GetDatasetRequest request;
    request.set_name(wanted);
    return running.datasets->GetDataset(&context, request, &dataset);
  };
  ASSERT_TRUE(get(name).ok());
  EXPECT_EQ(dataset.name(), name);
  EXPECT_EQ(dataset.num_files(), 1);
  EXPECT_TRUE(dataset.has_seal_time());
  EXPECT_EQ(dataset.advice_size(), 1) << "it has no masks";
  for (const char* none : {"scenes/shelf/datasets/2", "scenes/shelf/datasets/9"}) {
    const grpc::Status status = get(none);
    EXPECT_EQ(status.error_code(), grpc::NOT_FOUND) << "not sealed, or not there";
    EXPECT_EQ(DetailOf(status).reason(), "NO_SUCH_DATASET");
    EXPECT_EQ(DetailOf(status).resource(), none);
  }
  EXPECT_EQ(DetailOf(get("scenes/shelf/uploads/1")).field(), "name");
}

}  // namespace
}  // namespace pepeseg
