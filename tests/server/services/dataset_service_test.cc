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
#include "server/store/layout.h"
#include "tests/server/service_test.h"

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

struct DatasetServiceTest : EmptyScene {
  DatasetServiceTest() : EmptyScene(PEPESEG_FAKE_WORKER) {}

  Reply<v1::Upload> Create(const std::vector<v1::FileDeclaration>& files,
                           const std::string& request_id = "") const {
    v1::CreateUploadRequest request;
    request.set_parent("scenes/shelf");
    request.mutable_files()->Add(files.begin(), files.end());
    request.set_request_id(request_id);
    return Call(&DatasetStub::CreateUpload, request);
  }
  // Creates an upload of these files and returns its name.
  std::string Begin(const std::vector<TestFile>& files) const {
    return running.CreateUpload("shelf", files).name();
  }
  Reply<v1::Dataset> Seal(const std::string& name) const {
    return Call(&DatasetStub::SealUpload, Named{name});
  }
  // Expects that a stream of these parts to upload 1 fails and keeps nothing.
  void ExpectWriteFails(const std::vector<v1::WriteFilesRequest>& parts, grpc::StatusCode code,
                        const std::string& words) {
    EXPECT_ERROR(running.Write(parts), code, {.message = words});
    EXPECT_EQ(running.CountBlobFiles(), 0);
    EXPECT_EQ(running.GetUpload("scenes/shelf/uploads/1").missing_files_size(), 1);
  }
};

// Returns the parts of several files for one stream.
std::vector<v1::WriteFilesRequest> AllParts(const std::string& upload,
                                            const std::vector<TestFile>& files) {
  std::vector<v1::WriteFilesRequest> parts;
  for (const TestFile& file : files) {
    for (auto& part : FileParts(upload, file)) parts.push_back(std::move(part));
  }
  return parts;
}

TEST_F(DatasetServiceTest, TakesFilesAndSeals) {
  const std::vector<TestFile> files = {{"images/1.jpg", ManyBytes(3'500'000, 1)},
                                       {"images/2.jpg", "x"},
                                       {"sparse/0/cameras.bin", "cameras", v1::FILE_KIND_POSES}};
  const v1::Upload upload = running.CreateUpload("shelf", files);
  EXPECT_EQ(upload.name(), "scenes/shelf/uploads/1");
  EXPECT_EQ(upload.missing_files_size(), 3);
  EXPECT_EQ(upload.num_bytes(), 3'500'008);
  v1::WriteFilesResponse response;
  ASSERT_OK(running.Write(AllParts(upload.name(), files), &response));
  EXPECT_EQ(response.num_files(), 3);
  EXPECT_EQ(response.num_bytes(), 3'500'008);
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 0);
  ASSERT_OK_AND_ASSIGN(auto dataset, Seal(upload.name()));
  EXPECT_EQ(dataset.name(), "scenes/shelf/datasets/1");
  EXPECT_EQ(dataset.num_files(), 3);
  EXPECT_TRUE(dataset.has_seal_time());
  EXPECT_TRUE(running.GetUpload(upload.name()).sealed());
  EXPECT_OK(Seal(upload.name())) << "twice is no error";

  const auto blob = BlobPath(running.options.data, {"default", Declare(files[0]).sha256()});
  std::ostringstream stored;
  stored << std::ifstream(blob, std::ios::binary).rdbuf();
  EXPECT_EQ(stored.str(), files[0].bytes);
  std::ifstream file(DatasetManifestPath(running.options.data, {1, "default", "shelf"}, 1));
  const auto manifest = nlohmann::json::parse(file);
  EXPECT_EQ(manifest["files"].size(), 3u);
  EXPECT_EQ(manifest["files"][2]["path"], "sparse/0/cameras.bin");
  EXPECT_EQ(manifest["files"][2]["kind"], "FILE_KIND_POSES");
}

TEST_F(DatasetServiceTest, AdvisesMasksIfADatasetHasNone) {
  const auto advice = [this](const std::vector<TestFile>& files) {
    running.UploadAndSeal("shelf", files);
    const v1::ListDatasetsResponse all = *Call(&DatasetStub::ListDatasets, Under{"scenes/shelf"});
    return all.datasets(all.datasets_size() - 1).advice();
  };
  const TestFile photograph{"images/1.jpg", "x"};
  const TestFile mask{"masks/1.png", "y", v1::FILE_KIND_MASK};
  EXPECT_TRUE(advice({photograph, mask}).empty());
  const auto without = advice({photograph});
  ASSERT_EQ(without.size(), 1);
  EXPECT_NE(without[0].find("pepeseg-priors"), std::string::npos) << without[0];
  EXPECT_EQ(Seal("scenes/shelf/uploads/2")->advice_size(), 1);

  running.options.workers.priors_command = "/bin/true";
  running.Restart();
  EXPECT_TRUE(advice({photograph}).empty()) << "the server makes masks by its command";
}

TEST_F(DatasetServiceTest, AdvisesMasksIfAllMasksSayWhatToIgnore) {
  const TestFile poses{"transforms.json",
                       R"({"frames": [{"file_path": "images/1.jpg", "mask_path": "keep/1.png"}]})",
                       v1::FILE_KIND_POSES};
  const TestFile photograph{"images/1.jpg", "x"};
  const TestFile keep{"keep/1.png", "y", v1::FILE_KIND_MASK};
  const TestFile mask{"masks/1.png", "z", v1::FILE_KIND_MASK};
  const auto num_advice = [this](const std::string& dataset) {
    v1::GetDatasetRequest request;
    request.set_name(dataset);
    return Call(&DatasetStub::GetDataset, request)->advice_size();
  };
  EXPECT_EQ(num_advice(running.UploadAndSeal("shelf", {poses, photograph, keep})), 1);
  EXPECT_EQ(num_advice(running.UploadAndSeal("shelf", {poses, photograph, keep, mask})), 0);
  EXPECT_EQ(num_advice(running.UploadAndSeal("shelf", {photograph, keep})), 0)
      << "nothing names it";
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
  const std::string upload = Begin({one, two});
  {
    grpc::ClientContext context;
    v1::WriteFilesResponse response;
    const auto stream = running.datasets->WriteFiles(&context, &response);
    for (const auto& part : FileParts(upload, one)) ASSERT_TRUE(stream->Write(part));
    ASSERT_TRUE(stream->Write(HeaderPart(upload, two.path)));
    ASSERT_TRUE(stream->Write(ChunkPart(two.bytes.substr(0, 1'000'000))));
    ASSERT_TRUE(Eventually([&] { return running.CountPartialFiles() == 2; }));
    context.TryCancel();
    EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  }
  // The complete file is committed when the stream ends.
  EXPECT_TRUE(Eventually([&] { return running.CountBlobFiles() > 0; }, absl::Seconds(20)));
  EXPECT_EQ(running.CountBlobFiles(), 1);
  const v1::Upload after = running.GetUpload(upload);
  ASSERT_EQ(after.missing_files_size(), 1);
  EXPECT_EQ(after.missing_files(0), two.path);
  // Sent from its start, although a part is there; works once the first stream has released it.
  grpc::Status status;
  EXPECT_TRUE(Eventually([&] {
    status = running.Write(FileParts(upload, two));
    return status.error_code() != grpc::ABORTED;
  }));
  EXPECT_OK(status);
  EXPECT_EQ(running.CountPartialFiles(), 0);
  EXPECT_OK(Seal(upload));
}

TEST_F(DatasetServiceTest, RefusesWrongBytesAndKeepsNothing) {
  const TestFile good{"images/1.jpg", "0123456789"};
  const std::string name = Begin({good});
  const auto header = HeaderPart(name, good.path);

  ExpectWriteFails({header, ChunkPart("012345678X"), EndPart()}, grpc::DATA_LOSS, "SHA-256");
  ExpectWriteFails({header, ChunkPart("01234"), EndPart()}, grpc::INVALID_ARGUMENT,
                   "images/1.jpg: ended after 5 of the 10 bytes declared");
  ExpectWriteFails({header, ChunkPart("01234"), ChunkPart("567890"), EndPart()},
                   grpc::INVALID_ARGUMENT, "more bytes than the 10 declared");
  ExpectWriteFails({header, ChunkPart(good.bytes)}, grpc::INVALID_ARGUMENT,
                   "images/1.jpg: the stream ended before its end");
  EXPECT_OK(running.Write(FileParts(name, good)));
}

TEST_F(DatasetServiceTest, RefusesMessagesOutOfOrder) {
  const TestFile good{"images/1.jpg", "0123456789"};
  const std::string name = Begin({good});
  const auto header = HeaderPart(name, good.path);
  for (const auto& part : {ChunkPart("x"), EndPart(), v1::WriteFilesRequest()}) {
    ExpectWriteFails({part}, grpc::INVALID_ARGUMENT, "where a header must be");
  }
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
  EXPECT_ERROR(Create({Declare({"ok", "a"}), Declare(file)}), grpc::INVALID_ARGUMENT,
               {.field = "files[1].path", .value = "../../x"});
  file.path = "x";
  auto declaration = Declare(file);
  declaration.set_size(-5);
  EXPECT_ERROR(Create({declaration}), grpc::INVALID_ARGUMENT, "files[0].size");
  declaration = Declare(file);
  declaration.set_sha256("beef");
  EXPECT_ERROR(Create({declaration}), grpc::INVALID_ARGUMENT, "files[0].sha256");
  EXPECT_ERROR(Create({}), grpc::INVALID_ARGUMENT, "files");
  // These have created nothing.
  EXPECT_ERROR(Call(&DatasetStub::GetUpload, Named{"scenes/shelf/uploads/1"}), grpc::NOT_FOUND);
}

TEST_F(DatasetServiceTest, SealsOnlyCompleteUploads) {
  const TestFile one{"images/1.jpg", "one"};
  const TestFile two{"images/2.jpg", "two"};
  const std::string upload = Begin({one, two});
  ASSERT_OK(running.Write(FileParts(upload, one)));
  EXPECT_ERROR(Seal(upload), grpc::FAILED_PRECONDITION, {.message = "images/2.jpg"});
  EXPECT_FALSE(std::filesystem::exists(
      DatasetManifestPath(running.options.data, {1, "default", "shelf"}, 1)));
  ASSERT_OK(running.Write(FileParts(upload, two)));
  ASSERT_OK(Seal(upload));
  EXPECT_ERROR(running.Write(FileParts(upload, two)), grpc::FAILED_PRECONDITION);
}

TEST_F(DatasetServiceTest, DoesNotAskForStoredBytesAgain) {
  const TestFile one{"images/1.jpg", "the same"};
  const TestFile two{"copies/1.jpg", "the same"};
  v1::Upload upload = running.CreateUpload("shelf", {one, two});
  ASSERT_OK(running.Write(FileParts(upload.name(), one)));
  EXPECT_EQ(running.GetUpload(upload.name()).missing_files_size(), 0);
  EXPECT_OK(Seal(upload.name()));
  upload = running.CreateUpload("shelf", {two});
  EXPECT_EQ(upload.name(), "scenes/shelf/uploads/2");
  EXPECT_EQ(upload.missing_files_size(), 0);
  EXPECT_OK(Seal(upload.name()));
  EXPECT_EQ(running.CountBlobFiles(), 1);
}

TEST_F(DatasetServiceTest, AcceptsTheSameDigestTwiceInAGroup) {
  const std::vector<TestFile> files = {
      {"a.jpg", "the same"}, {"b.jpg", "other"}, {"c.jpg", "the same"}};
  const std::string upload = Begin(files);
  v1::WriteFilesResponse response;
  ASSERT_OK(running.Write(AllParts(upload, files), &response));
  EXPECT_EQ(response.num_files(), 3);
  EXPECT_EQ(running.GetUpload(upload).missing_files_size(), 0);
  EXPECT_OK(Seal(upload));
}

// Files that were complete before an error are stored, whatever the error.
TEST_F(DatasetServiceTest, KeepsTheGroupBeforeAnError) {
  std::vector<TestFile> files;
  for (int i = 0; i < 40; ++i) {
    files.push_back({absl::StrCat("images/", 100 + i), absl::StrCat("bytes ", i)});
  }
  const std::string upload = Begin(files);
  auto parts = AllParts(upload, files);
  parts[parts.size() - 2] = ChunkPart("wrong");
  EXPECT_ERROR(running.Write(parts), grpc::INVALID_ARGUMENT);
  const v1::Upload after = running.GetUpload(upload);
  ASSERT_EQ(after.missing_files_size(), 1);
  EXPECT_EQ(after.missing_files(0), "images/139");
}

TEST_F(DatasetServiceTest, KeepsNothingOfADeletedUpload) {
  const TestFile file{"images/1.jpg", ManyBytes(3'000'000, 2)};
  const std::string upload = Begin({file});
  grpc::ClientContext context;
  v1::WriteFilesResponse response;
  const auto stream = running.datasets->WriteFiles(&context, &response);
  ASSERT_TRUE(stream->Write(HeaderPart(upload, file.path)));
  ASSERT_TRUE(stream->Write(ChunkPart(file.bytes.substr(0, 1'000'000))));
  ASSERT_TRUE(Eventually([&] { return running.CountPartialFiles() > 0; }));
  ASSERT_OK(Call(&SceneStub::DeleteScene, Named{"scenes/shelf"}));
  stream->WritesDone();
  EXPECT_FALSE(stream->Finish().ok());
  EXPECT_EQ(running.CountPartialFiles(), 0);
}

TEST_F(DatasetServiceTest, RemovesPartialFilesOfDeletedScenes) {
  const TestFile file{"images/1.jpg", ManyBytes(3'000'000, 2)};
  EXPECT_FALSE(running.Write({HeaderPart(Begin({file}), file.path), ChunkPart("beginning")}).ok());
  ASSERT_GE(running.CountPartialFiles(), 1);
  ASSERT_OK(Call(&SceneStub::DeleteScene, Named{"scenes/shelf"}));
  EXPECT_EQ(running.CountPartialFiles(), 0);
}

TEST_F(DatasetServiceTest, ReturnsTheSameUploadToARetry) {
  const TestFile one{"images/1.jpg", "one"};
  ASSERT_OK(Create({Declare(one)}, "r1"));
  EXPECT_EQ(Create({Declare(one)}, "r1")->name(), "scenes/shelf/uploads/1");
  EXPECT_ERROR(Create({Declare({"images/2.jpg", "two"})}, "r1"), grpc::ALREADY_EXISTS);
}

TEST_F(DatasetServiceTest, TakesManyStreamsAtOnce) {
  std::vector<TestFile> files;
  for (int i = 0; i < 24; ++i) {
    files.push_back({"images/" + std::to_string(i), ManyBytes(200'000 + 1000 * i, i)});
  }
  const std::string upload = Begin(files);
  std::atomic<int> written = 0;
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, t] {
      for (int i = t; i < 24; i += 8) {
        grpc::Status status;
        do {
          status = running.Write(FileParts(upload, files[i], 64'000));
        } while (status.error_code() == grpc::ABORTED);
        written += status.ok() ? 1 : 0;
        // A stream that sends a file which another stream writes is refused, without harm.
        running.Write(FileParts(upload, files[(i + 1) % 24], 64'000));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(written, 24);
  EXPECT_OK(Seal(upload));
  EXPECT_EQ(running.CountBlobFiles(), 24);
}

TEST_F(DatasetServiceTest, ListsSealedDatasets) {
  running.UploadAndSeal("shelf", {{"images/1.jpg", "one"}});
  running.CreateUpload("shelf", {{"images/2.jpg", "two"}});
  running.UploadAndSeal("shelf", {{"images/3.jpg", "three"}});
  ASSERT_OK_AND_ASSIGN(const v1::ListDatasetsResponse response,
                       Call(&DatasetStub::ListDatasets, Under{"scenes/shelf"}));
  ASSERT_EQ(response.datasets_size(), 2);
  EXPECT_EQ(response.datasets(0).name(), "scenes/shelf/datasets/1");
  EXPECT_EQ(response.datasets(1).name(), "scenes/shelf/datasets/3");
}

TEST_F(DatasetServiceTest, GetsASealedDataset) {
  const std::string name = running.UploadAndSeal("shelf", {{"images/1.jpg", "one"}});
  running.CreateUpload("shelf", {{"images/2.jpg", "two"}});
  const auto get = [&](const std::string& wanted) {
    return Call(&DatasetStub::GetDataset, Named{wanted});
  };
  ASSERT_OK_AND_ASSIGN(const v1::Dataset dataset, get(name));
  EXPECT_EQ(dataset.name(), name);
  EXPECT_EQ(dataset.num_files(), 1);
  EXPECT_TRUE(dataset.has_seal_time());
  EXPECT_EQ(dataset.advice_size(), 1) << "it has no masks";
  for (const char* none : {"scenes/shelf/datasets/2", "scenes/shelf/datasets/9"}) {
    EXPECT_ERROR(get(none), grpc::NOT_FOUND, {.reason = "NO_SUCH_DATASET", .resource = none})
        << "not sealed, or not there";
  }
  EXPECT_ERROR(get("scenes/shelf/uploads/1"), grpc::INVALID_ARGUMENT, "name");
}

}  // namespace
}  // namespace pepeseg
