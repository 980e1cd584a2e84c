#include "tests/server/running_server.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/digest.h"
#include "server/store/layout.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Entries that are created or removed meanwhile may be missed.
int64_t CountFiles(const std::filesystem::path& folder) {
  int64_t count = 0;
  std::error_code error;
  for (std::filesystem::recursive_directory_iterator entry(folder, error), end;
       !error && entry != end; entry.increment(error)) {
    std::error_code ignored;
    count += entry->is_regular_file(ignored) ? 1 : 0;
  }
  return count;
}

}  // namespace

v1::FileDeclaration Declare(const TestFile& file) {
  v1::FileDeclaration declaration;
  declaration.set_path(file.path);
  declaration.set_kind(file.kind);
  declaration.set_size(static_cast<int64_t>(file.bytes.size()));
  declaration.set_sha256(Sha256Hex(file.bytes));
  return declaration;
}

v1::WriteFilesRequest HeaderPart(const std::string& upload, const std::string& path,
                                 int64_t offset) {
  v1::WriteFilesRequest part;
  part.mutable_header()->set_upload(upload);
  part.mutable_header()->set_path(path);
  part.mutable_header()->set_offset(offset);
  return part;
}

v1::WriteFilesRequest ChunkPart(const std::string& bytes) {
  v1::WriteFilesRequest part;
  part.set_chunk(bytes);
  return part;
}

v1::WriteFilesRequest EndPart() {
  v1::WriteFilesRequest part;
  part.mutable_end();
  return part;
}

std::vector<v1::WriteFilesRequest> FileParts(const std::string& upload, const TestFile& file,
                                             size_t chunk_bytes) {
  std::vector<v1::WriteFilesRequest> parts = {HeaderPart(upload, file.path)};
  for (size_t i = 0; i < file.bytes.size(); i += chunk_bytes) {
    parts.push_back(ChunkPart(file.bytes.substr(i, chunk_bytes)));
  }
  parts.push_back(EndPart());
  return parts;
}

RunningServer::RunningServer(const std::string& worker, const ServerOptions& settings)
    : options(settings) {
  options.data = folder / "data";
  options.worker = worker;
  options.devices = "cpu";
  options.num_threads = 1;
  options.launch.crash_pauses = {absl::Milliseconds(10)};
  Restart();
}

void RunningServer::Restart() {
  server.reset();
  auto started = Server::Start(options);
  EXPECT_OK(started);
  if (!started.ok()) return;
  server = *std::move(started);
  channel = server->InProcessChannel();
  datasets = v1::DatasetService::NewStub(channel);
  jobs = v1::JobService::NewStub(channel);
  segmentation = v1::SegmentationService::NewStub(channel);
  edits = v1::EditService::NewStub(channel);
  renders = v1::RenderService::NewStub(channel);
  evaluations = v1::EvaluationService::NewStub(channel);
}

void RunningServer::CreateScene(const std::string& id) const {
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  EXPECT_OK(Call(&SceneStub::CreateScene, request));
}

v1::Upload RunningServer::CreateUpload(const std::string& scene,
                                       const std::vector<TestFile>& files) const {
  v1::CreateUploadRequest request;
  request.set_parent("scenes/" + scene);
  for (const TestFile& file : files) *request.add_files() = Declare(file);
  return *Call(&DatasetStub::CreateUpload, request);
}

grpc::Status RunningServer::Write(const std::vector<v1::WriteFilesRequest>& parts,
                                  v1::WriteFilesResponse* response) {
  grpc::ClientContext context;
  v1::WriteFilesResponse unused;
  const auto stream = datasets->WriteFiles(&context, response != nullptr ? response : &unused);
  for (const v1::WriteFilesRequest& part : parts) {
    if (!stream->Write(part)) break;  // the server has ended it: Finish() returns why
  }
  stream->WritesDone();
  return stream->Finish();
}

v1::Upload RunningServer::GetUpload(const std::string& name) const {
  return *Call(&DatasetStub::GetUpload, Named{name});
}

std::string RunningServer::UploadAndSeal(const std::string& scene,
                                         const std::vector<TestFile>& files) {
  const v1::Upload upload = CreateUpload(scene, files);
  for (const TestFile& file : files) EXPECT_OK(Write(FileParts(upload.name(), file)));
  return Call(&DatasetStub::SealUpload, Named{upload.name()})->name();
}

v1::Job RunningServer::Train(const std::string& scene, const std::string& file) {
  v1::TrainSceneRequest request;
  request.set_scene("scenes/" + scene);
  request.set_dataset(UploadAndSeal(scene, {{file, "bytes"}}));
  return *Call(&JobStub::TrainScene, request);
}

v1::Job RunningServer::Await(const std::string& name) const {
  v1::Job job;
  EXPECT_TRUE(testing::Eventually([&] {
    const auto reply = Call(&JobStub::GetJob, Named{name});
    job = *reply;
    return !reply.ok() || job.has_end_time();
  })) << name
      << ": " << job.DebugString();
  return job;
}

int64_t RunningServer::CountBlobFiles() const { return CountFiles(BlobFolder(options.data)); }

int64_t RunningServer::CountPartialFiles() const { return CountFiles(PartialFolder(options.data)); }

}  // namespace pepeseg
