#include "tests/server/service_client.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/dataset/import.h"
#include "tests/server/file_kind.h"
#include "tests/testing/eventually.h"
#include "tests/testing/status_testing.h"

namespace pepeseg::testing {
namespace {

constexpr size_t kChunkBytes = 256 << 10;
constexpr int64_t kMaxFileBytes = int64_t{1} << 30;
constexpr std::chrono::minutes kPatience(4);

absl::Status ToStatus(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

// A call with a deadline, so that a server that hangs fails the test.
struct Call {
  Call() { context.set_deadline(std::chrono::system_clock::now() + kPatience); }
  grpc::ClientContext context;
};

template <class Stub, class Request, class Response>
absl::StatusOr<Response> Ask(const std::shared_ptr<grpc::Channel>& channel,
                             Method<Stub, Request, Response> method,
                             const std::type_identity_t<Request>& request) {
  const Reply<Response> reply = CallOver(channel, method, request);
  if (!reply.ok()) return ToStatus(reply);
  return *reply;
}

}  // namespace

std::vector<ClientFile> ReadDataset(const std::filesystem::path& folder) {
  const auto listed = ListDataset(folder);
  EXPECT_OK(listed);
  std::vector<ClientFile> files;
  if (!listed.ok()) return files;
  for (const DatasetFile& file : *listed) {
    files.push_back({file.name, ToProto(file.kind),
                     ReadFile(file.path, file.name, kMaxFileBytes).value_or("")});
  }
  return files;
}

ClientFile& FileOf(std::vector<ClientFile>& files, const std::string& path) {
  const auto found = std::find_if(files.begin(), files.end(),
                                  [&](const ClientFile& file) { return file.path == path; });
  EXPECT_NE(found, files.end()) << path;
  return found == files.end() ? files.front() : *found;
}

absl::Status ServiceClient::CreateScene(const std::string& id) {
  v1::CreateSceneRequest request;
  request.set_scene_id(id);
  return Ask(channel_, &SceneStub::CreateScene, request).status();
}

absl::StatusOr<v1::Upload> ServiceClient::CreateUpload(const std::string& scene,
                                                       const std::vector<ClientFile>& files) {
  v1::CreateUploadRequest request;
  request.set_parent("scenes/" + scene);
  for (const ClientFile& file : files) {
    v1::FileDeclaration& declared = *request.add_files();
    declared.set_path(file.path);
    declared.set_kind(file.kind);
    declared.set_size(static_cast<int64_t>(file.bytes.size()));
    declared.set_sha256(Sha256Hex(file.bytes));
  }
  return Ask(channel_, &DatasetStub::CreateUpload, request);
}

absl::Status ServiceClient::WriteFiles(const v1::Upload& upload,
                                       const std::vector<ClientFile>& files, size_t max_bytes) {
  Call call;
  v1::WriteFilesResponse response;
  const auto stream = DatasetStub(channel_).WriteFiles(&call.context, &response);
  size_t sent = 0;
  for (const ClientFile& file : files) {
    v1::WriteFilesRequest request;
    request.mutable_header()->set_upload(upload.name());
    request.mutable_header()->set_path(file.path);
    stream->Write(request);
    for (size_t offset = 0; offset < file.bytes.size(); offset += kChunkBytes) {
      const std::string data = file.bytes.substr(offset, kChunkBytes);
      request.set_chunk(data);
      stream->Write(request);
      sent += data.size();
      if (sent < max_bytes) continue;
      call.context.TryCancel();
      return ToStatus(stream->Finish());
    }
    request.mutable_end();
    if (!stream->Write(request)) break;
  }
  stream->WritesDone();
  return ToStatus(stream->Finish());
}

absl::Status ServiceClient::SendFrom(const v1::Upload& upload, const ClientFile& file,
                                     std::pair<int64_t, int64_t> range) {
  Call call;
  v1::WriteFilesResponse response;
  const auto stream = DatasetStub(channel_).WriteFiles(&call.context, &response);
  v1::WriteFilesRequest request;
  request.mutable_header()->set_upload(upload.name());
  request.mutable_header()->set_path(file.path);
  request.mutable_header()->set_offset(range.first);
  bool open = stream->Write(request);
  const auto end = static_cast<size_t>(range.second);
  for (auto at = static_cast<size_t>(range.first); open && at < end; at += kChunkBytes) {
    request.set_chunk(file.bytes.substr(at, std::min(kChunkBytes, end - at)));
    open = stream->Write(request);
  }
  if (end == file.bytes.size()) {
    request.mutable_end();
    if (open) stream->Write(request);
    stream->WritesDone();
  }
  return ToStatus(stream->Finish());
}

absl::StatusOr<v1::Upload> ServiceClient::GetUpload(const std::string& name) {
  return Ask(channel_, &DatasetStub::GetUpload, Named{name});
}

absl::StatusOr<v1::Dataset> ServiceClient::SealUpload(const std::string& name) {
  return Ask(channel_, &DatasetStub::SealUpload, Named{name});
}

absl::StatusOr<std::string> ServiceClient::Upload(const std::string& scene,
                                                  const std::vector<ClientFile>& files) {
  ASSIGN_OR_RETURN(const v1::Upload upload, CreateUpload(scene, files));
  std::vector<ClientFile> missing;
  for (const ClientFile& file : files) {
    const auto& paths = upload.missing_files();
    if (std::find(paths.begin(), paths.end(), file.path) != paths.end()) missing.push_back(file);
  }
  if (!missing.empty()) RETURN_IF_ERROR(WriteFiles(upload, missing));
  ASSIGN_OR_RETURN(const v1::Dataset dataset, SealUpload(upload.name()));
  return dataset.name();
}

absl::StatusOr<v1::Job> ServiceClient::Train(const std::string& scene, const std::string& dataset,
                                             const v1::TrainingOptions& options) {
  v1::TrainSceneRequest request;
  request.set_scene("scenes/" + scene);
  request.set_dataset(dataset);
  *request.mutable_options() = options;
  return Ask(channel_, &JobStub::TrainScene, request);
}

absl::StatusOr<v1::Job> ServiceClient::GetJob(const std::string& name) {
  return Ask(channel_, &JobStub::GetJob, Named{name});
}

absl::StatusOr<v1::Job> ServiceClient::CancelJob(const std::string& name) {
  return Ask(channel_, &JobStub::CancelJob, Named{name});
}

absl::StatusOr<std::vector<v1::JobEvent>> ServiceClient::Watch(const std::string& name) {
  Call call;
  v1::WatchJobRequest request = Named{name};
  request.set_after_sequence(0);
  const auto stream = JobStub(channel_).WatchJob(&call.context, request);
  std::vector<v1::JobEvent> events;
  v1::JobEvent event;
  while (stream->Read(&event)) events.push_back(event);
  const grpc::Status status = stream->Finish();
  if (!status.ok()) return ToStatus(status);
  return events;
}

absl::StatusOr<v1::Job> ServiceClient::WaitForJob(const std::string& name) {
  RETURN_IF_ERROR(Watch(name).status());
  return GetJob(name);
}

absl::StatusOr<v1::Job> ServiceClient::WaitForStep(const std::string& name) {
  absl::StatusOr<v1::Job> job;
  EXPECT_TRUE(Eventually([&] {
    job = GetJob(name);
    return !job.ok() || job->progress().step() > 0;
  })) << name;
  return job;
}

absl::StatusOr<v1::Model> ServiceClient::GetModel(const std::string& name) {
  return Ask(channel_, &SceneStub::GetModel, Named{name});
}

absl::StatusOr<v1::EstimateTrainingResponse> ServiceClient::Estimate(
    const std::string& scene, const std::string& dataset, const v1::TrainingOptions& options) {
  v1::EstimateTrainingRequest request;
  request.set_scene(scene);
  request.set_dataset(dataset);
  *request.mutable_options() = options;
  return Ask(channel_, &JobStub::EstimateTraining, request);
}

absl::StatusOr<std::vector<v1::View>> ServiceClient::ListViews(const std::string& model) {
  v1::ListViewsRequest request;
  request.set_parent(model);
  request.set_page_size(1000);
  ASSIGN_OR_RETURN(const v1::ListViewsResponse response,
                   Ask(channel_, &SceneStub::ListViews, request));
  return std::vector<v1::View>(response.views().begin(), response.views().end());
}

absl::StatusOr<v1::SegmentViewsResponse> ServiceClient::Segment(
    const v1::SegmentViewsRequest& request) {
  return Ask(channel_, &SegmentationStub::SegmentViews, request);
}

absl::StatusOr<v1::RenderViewResponse> ServiceClient::Render(const std::string& model,
                                                             const std::string& view) {
  v1::RenderViewRequest request;
  request.set_model(model);
  request.mutable_viewpoint()->set_view(view);
  return Ask(channel_, &RenderStub::RenderView, request);
}

absl::StatusOr<std::string> ServiceClient::Export(const std::string& model) {
  Call call;
  v1::ExportGaussiansRequest request;
  request.set_model(model);
  const auto stream = RenderStub(channel_).ExportGaussians(&call.context, request);
  v1::ExportGaussiansResponse::Header header;
  std::string ply;
  v1::ExportGaussiansResponse part;
  while (stream->Read(&part)) {
    if (part.has_header()) header = part.header();
    if (part.has_chunk()) ply += part.chunk();
  }
  const grpc::Status status = stream->Finish();
  if (!status.ok()) return ToStatus(status);
  if (header.sha256() != Sha256Hex(ply)) return absl::DataLossError("the PLY is not as announced");
  return ply;
}

}  // namespace pepeseg::testing
