#include "tests/server/running_server.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "absl/time/clock.h"
#include "core/base/digest.h"
#include "server/api/error.h"
#include "server/store/layout.h"

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

v1::Error DetailOf(const grpc::Status& status) {
  v1::Status proto;
  EXPECT_TRUE(proto.ParseFromString(status.error_details()));
  EXPECT_GE(proto.details_size(), 1) << status.error_message();
  for (const auto& detail : proto.details()) {
    EXPECT_TRUE(detail.type_url().starts_with("type.googleapis.com/google.rpc."))
        << detail.type_url();
  }
  return FlatError(proto);
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
  part.mutable_chunk()->set_data(bytes);
  part.mutable_chunk()->set_crc32c(Crc32c(bytes));
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
  options.device = "cpu";
  options.num_threads = 1;
  options.launch.crash_pauses = {absl::Milliseconds(10)};
  Restart();
}

void RunningServer::Restart() {
  server.reset();
  auto started = Server::Start(options);
  EXPECT_TRUE(started.ok()) << started.status();
  if (!started.ok()) return;
  server = *std::move(started);
  channel = server->InProcessChannel();
  scenes = v1::SceneService::NewStub(channel);
  datasets = v1::DatasetService::NewStub(channel);
  jobs = v1::JobService::NewStub(channel);
  segmentation = v1::SegmentationService::NewStub(channel);
  labels = v1::LabelService::NewStub(channel);
  selections = v1::SelectionService::NewStub(channel);
  renders = v1::RenderService::NewStub(channel);
  evaluations = v1::EvaluationService::NewStub(channel);
  const auto admin_channel = server->InProcessAdminChannel();
  if (admin_channel != nullptr) admin = v1::AdminService::NewStub(admin_channel);
}

void RunningServer::CreateScene(const std::string& id) {
  grpc::ClientContext context;
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  v1::Scene scene;
  const grpc::Status status = scenes->CreateScene(&context, request, &scene);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

v1::Upload RunningServer::CreateUpload(const std::string& scene,
                                       const std::vector<TestFile>& files) {
  grpc::ClientContext context;
  v1::CreateUploadRequest request;
  request.set_parent("scenes/" + scene);
  for (const TestFile& file : files) *request.add_files() = Declare(file);
  v1::Upload upload;
  const grpc::Status status = datasets->CreateUpload(&context, request, &upload);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return upload;
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

v1::Upload RunningServer::GetUpload(const std::string& name) {
  grpc::ClientContext context;
  v1::GetUploadRequest request;
  request.set_name(name);
  v1::Upload upload;
  const grpc::Status status = datasets->GetUpload(&context, request, &upload);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return upload;
}

std::string RunningServer::UploadAndSeal(const std::string& scene,
                                         const std::vector<TestFile>& files) {
  const v1::Upload upload = CreateUpload(scene, files);
  for (const TestFile& file : files) {
    const grpc::Status status = Write(FileParts(upload.name(), file));
    EXPECT_TRUE(status.ok()) << status.error_message();
  }
  grpc::ClientContext context;
  v1::SealUploadRequest request;
  request.set_name(upload.name());
  v1::Dataset dataset;
  const grpc::Status status = datasets->SealUpload(&context, request, &dataset);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return dataset.name();
}

v1::Job RunningServer::Train(const std::string& scene, const std::string& file) {
  grpc::ClientContext context;
  v1::TrainSceneRequest request;
  request.set_scene("scenes/" + scene);
  request.set_dataset(UploadAndSeal(scene, {{file, "bytes"}}));
  v1::Job job;
  const grpc::Status status = jobs->TrainScene(&context, request, &job);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return job;
}

v1::Job RunningServer::Await(const std::string& name) {
  const absl::Time deadline = absl::Now() + absl::Minutes(1);
  v1::Job job;
  while (absl::Now() < deadline) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    const grpc::Status status = jobs->GetJob(&context, request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    if (!status.ok() || job.has_end_time()) return job;
    absl::SleepFor(absl::Milliseconds(20));
  }
  ADD_FAILURE() << name << " has not ended: " << job.DebugString();
  return job;
}

int64_t RunningServer::CountBlobFiles() const { return CountFiles(BlobFolder(options.data)); }

int64_t RunningServer::CountPartialFiles() const { return CountFiles(PartialFolder(options.data)); }

}  // namespace pepeseg
