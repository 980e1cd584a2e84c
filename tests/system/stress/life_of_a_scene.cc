#include "tests/system/stress/life_of_a_scene.h"

#include <algorithm>
#include <chrono>
#include <functional>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr std::chrono::seconds kPatience{20};

absl::Status ToStatus(const grpc::Status& status) {
  return {static_cast<absl::StatusCode>(status.error_code()), status.error_message()};
}

struct TestFile {
  std::string path;
  std::string bytes;
};

// Returns files whose bytes depend on the scene, so that no other scene has stored them. The last
// is the largest. They are enough for the server to commit them as a group.
std::vector<TestFile> FilesOf(const std::string& id) {
  std::vector<TestFile> files;
  for (int i = 10; i < 30; ++i) {
    std::string bytes;
    while (bytes.size() < (i == 29 ? size_t{300'000} : size_t{2'000})) {
      absl::StrAppend(&bytes, id, " ", i, " ", bytes.size(), "\n");
    }
    files.push_back({absl::StrCat("images/", i, ".jpg"), std::move(bytes)});
  }
  return files;
}

// Writes a file to the stream. Returns false if the server has ended the stream.
bool WriteFile(grpc::ClientWriter<v1::WriteFilesRequest>& stream, const std::string& upload,
               const TestFile& file) {
  constexpr size_t kChunk = 64 << 10;
  v1::WriteFilesRequest part;
  part.mutable_header()->set_upload(upload);
  part.mutable_header()->set_path(file.path);
  bool open = stream.Write(part);
  for (size_t begin = 0; open && begin < file.bytes.size(); begin += kChunk) {
    part.set_chunk(file.bytes.substr(begin, kChunk));
    open = stream.Write(part);
  }
  part.mutable_end();
  return open && stream.Write(part);
}

v1::SegmentViewsRequest SmallQuery(const std::string& model) {
  v1::SegmentViewsRequest request;
  request.set_model(model);
  request.mutable_prompt()->mutable_view()->set_view("middle.jpg");
  auto& point = *request.mutable_prompt()->mutable_points()->add_points();
  point.set_x(30);
  point.set_y(32);
  request.mutable_granularity()->set_scale_quantile(0.5);
  request.mutable_granularity()->set_threshold(0.5);
  return request;
}

}  // namespace

struct LifeOfAScene::Stubs {
  explicit Stubs(const std::shared_ptr<grpc::Channel>& channel)
      : scenes(v1::SceneService::NewStub(channel)),
        datasets(v1::DatasetService::NewStub(channel)),
        jobs(v1::JobService::NewStub(channel)),
        segmentation(v1::SegmentationService::NewStub(channel)),
        labels(v1::LabelService::NewStub(channel)),
        selections(v1::SelectionService::NewStub(channel)) {}

  template <typename Stub, typename Request, typename Response>
  static absl::Status Call(Stub& stub,
                           grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                        Response*),
                           const Request& request, Response* response) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kPatience);
    return ToStatus((stub.*method)(&context, request, response));
  }

  std::unique_ptr<v1::SceneService::Stub> scenes;
  std::unique_ptr<v1::DatasetService::Stub> datasets;
  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation;
  std::unique_ptr<v1::LabelService::Stub> labels;
  std::unique_ptr<v1::SelectionService::Stub> selections;
};

absl::Status LifeOfAScene::Wrong(const std::string& what) {
  found_wrong_ = true;
  return absl::DataLossError(what);
}

absl::Status LifeOfAScene::Remember(std::string& known, const std::string& answer,
                                    const char* what) {
  if (known.empty()) known = answer;
  if (known == answer) return absl::OkStatus();
  return Wrong(absl::StrCat(id_, ": the ", what, " was '", known, "' and is '", answer, "'"));
}

absl::Status LifeOfAScene::Run(const std::shared_ptr<grpc::Channel>& channel) {
  Stubs stubs(channel);
  v1::CreateSceneRequest request;
  request.set_scene_id(id_);
  request.set_request_id(absl::StrCat(id_, "-scene"));
  v1::Scene scene;
  RETURN_IF_ERROR(
      Stubs::Call(*stubs.scenes, &v1::SceneService::Stub::CreateScene, request, &scene));
  RETURN_IF_ERROR(Remember(scene_, scene.name(), "scene"));
  RETURN_IF_ERROR(Upload(stubs));
  RETURN_IF_ERROR(Train(stubs));
  RETURN_IF_ERROR(Ask(stubs));
  RETURN_IF_ERROR(Keep(stubs));
  done_ = true;
  return absl::OkStatus();
}

absl::Status LifeOfAScene::Upload(Stubs& stubs) {
  v1::CreateUploadRequest request;
  request.set_parent(scene_);
  request.set_request_id("upload");
  for (const TestFile& file : FilesOf(id_)) {
    v1::FileDeclaration& declaration = *request.add_files();
    declaration.set_path(file.path);
    declaration.set_kind(v1::FILE_KIND_IMAGE);
    declaration.set_size(static_cast<int64_t>(file.bytes.size()));
    declaration.set_sha256(Sha256Hex(file.bytes));
  }
  v1::Upload upload;
  RETURN_IF_ERROR(
      Stubs::Call(*stubs.datasets, &v1::DatasetService::Stub::CreateUpload, request, &upload));
  RETURN_IF_ERROR(Remember(upload_, upload.name(), "upload"));
  if (!dataset_.empty() && !upload.sealed()) {
    return Wrong(absl::StrCat(dataset_, " was sealed and is not"));
  }
  if (!upload.sealed()) RETURN_IF_ERROR(WriteMissing(stubs, upload));
  v1::SealUploadRequest seal;
  seal.set_name(upload_);
  v1::Dataset dataset;
  RETURN_IF_ERROR(
      Stubs::Call(*stubs.datasets, &v1::DatasetService::Stub::SealUpload, seal, &dataset));
  return Remember(dataset_, dataset.name(), "dataset");
}

absl::Status LifeOfAScene::WriteMissing(Stubs& stubs, const v1::Upload& upload) {
  const std::vector<TestFile> files = FilesOf(id_);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  v1::WriteFilesResponse response;
  const auto stream = stubs.datasets->WriteFiles(&context, &response);
  for (const std::string& path : upload.missing_files()) {
    const auto file = std::find_if(files.begin(), files.end(),
                                   [&](const TestFile& one) { return one.path == path; });
    if (file == files.end()) return Wrong(absl::StrCat(path, " was never declared"));
    if (!WriteFile(*stream, upload_, *file)) break;  // Finish() returns why
  }
  stream->WritesDone();
  return ToStatus(stream->Finish());
}

absl::Status LifeOfAScene::Train(Stubs& stubs) {
  v1::TrainSceneRequest request;
  request.set_scene(scene_);
  request.set_dataset(dataset_);
  request.set_request_id(absl::StrCat("train", num_failed_));
  v1::Job job;
  RETURN_IF_ERROR(Stubs::Call(*stubs.jobs, &v1::JobService::Stub::TrainScene, request, &job));
  RETURN_IF_ERROR(Remember(job_, job.name(), "job"));
  if (job.state() == v1::JOB_STATE_QUEUED || job.state() == v1::JOB_STATE_RUNNING) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kPatience);
    v1::WatchJobRequest watch;
    watch.set_name(job_);
    watch.set_after_sequence(0);
    const auto stream = stubs.jobs->WatchJob(&context, watch);
    v1::JobEvent event;
    int64_t sequence = 0;
    while (stream->Read(&event)) {
      if (event.has_snapshot() || event.has_heartbeat()) continue;
      // Coalesced progress leaves gaps in the numbers, but they never decrease.
      if (event.sequence() <= sequence) {
        return Wrong(absl::StrCat(job_, ": event ", event.sequence(), " after ", sequence));
      }
      sequence = event.sequence();
    }
    RETURN_IF_ERROR(ToStatus(stream->Finish()));
  }
  v1::GetJobRequest get;
  get.set_name(job_);
  RETURN_IF_ERROR(Stubs::Call(*stubs.jobs, &v1::JobService::Stub::GetJob, get, &job));
  if (may_fail_ && job.state() == v1::JOB_STATE_FAILED) {
    job_.clear();
    ++num_failed_;
    return {static_cast<absl::StatusCode>(job.error().code()), job.error().message()};
  }
  if (job.state() != v1::JOB_STATE_SUCCEEDED) {
    return Wrong(absl::StrCat(job_, " ended as ", v1::JobState_Name(job.state()), ": ",
                              job.error().message()));
  }
  return Remember(model_, job.model(), "model");
}

absl::Status LifeOfAScene::Ask(Stubs& stubs) {
  v1::SegmentViewsResponse response;
  RETURN_IF_ERROR(Stubs::Call(*stubs.segmentation, &v1::SegmentationService::Stub::SegmentViews,
                              SmallQuery(absl::StrCat(scene_, "/models/live")), &response));
  RETURN_IF_ERROR(Remember(model_, response.model(), "live model"));
  if (response.masks_size() != 1) return Wrong("no mask");
  return Remember(mask_, response.masks(0).rle().SerializeAsString(), "mask");
}

absl::Status LifeOfAScene::Keep(Stubs& stubs) {
  using Labels = v1::LabelService::Stub;
  using Selections = v1::SelectionService::Stub;
  if (!label_deleted_) {
    v1::CreateLabelRequest request;
    request.set_parent(scene_);
    request.set_label_id("left");
    request.set_request_id("label");
    request.mutable_label()->set_text("the left square");
    request.mutable_label()->set_view("middle.jpg");
    request.mutable_label()->mutable_mask()->mutable_rle()->ParseFromString(mask_);
    v1::Label label;
    RETURN_IF_ERROR(Stubs::Call(*stubs.labels, &Labels::CreateLabel, request, &label));
    RETURN_IF_ERROR(Remember(label_, label.name(), "label"));
  }
  v1::CreateSelectionRequest select;
  const v1::SegmentViewsRequest query = SmallQuery(model_);
  select.set_model(model_);
  *select.mutable_prompt() = query.prompt();
  *select.mutable_granularity() = query.granularity();
  select.set_request_id("select");
  v1::Selection selection;
  RETURN_IF_ERROR(Stubs::Call(*stubs.selections, &Selections::CreateSelection, select, &selection));
  RETURN_IF_ERROR(Remember(selection_, selection.name(), "selection"));
  v1::CombineSelectionsRequest combine;
  combine.set_first(selection_);
  combine.set_second(selection_);
  combine.set_operation(v1::SET_OPERATION_UNION);
  combine.set_request_id("combine");
  RETURN_IF_ERROR(
      Stubs::Call(*stubs.selections, &Selections::CombineSelections, combine, &selection));
  RETURN_IF_ERROR(Remember(second_, selection.name(), "combined selection"));
  v1::DeleteLabelRequest remove;
  remove.set_name(label_);
  google::protobuf::Empty nothing;
  const absl::Status removed = Stubs::Call(*stubs.labels, &Labels::DeleteLabel, remove, &nothing);
  // NOT_FOUND: an earlier deletion, whose answer was lost, has happened.
  if (!removed.ok() && !absl::IsNotFound(removed)) return removed;
  label_deleted_ = true;
  return absl::OkStatus();
}

absl::Status LifeOfAScene::Delete(const std::shared_ptr<grpc::Channel>& channel) {
  Stubs stubs(channel);
  v1::DeleteSceneRequest request;
  request.set_name(scene_);
  google::protobuf::Empty nothing;
  return Stubs::Call(*stubs.scenes, &v1::SceneService::Stub::DeleteScene, request, &nothing);
}

absl::Status LifeOfAScene::Check(const std::shared_ptr<grpc::Channel>& channel) {
  Stubs stubs(channel);
  v1::GetSceneRequest get;
  get.set_name(scene_);
  v1::Scene scene;
  if (!scene_.empty()) {
    RETURN_IF_ERROR(Stubs::Call(*stubs.scenes, &v1::SceneService::Stub::GetScene, get, &scene));
  }
  if (!selection_.empty()) {
    v1::GetSelectionRequest request;
    request.set_name(selection_);
    v1::Selection selection;
    RETURN_IF_ERROR(Stubs::Call(*stubs.selections, &v1::SelectionService::Stub::GetSelection,
                                request, &selection));
  }
  return mask_.empty() ? absl::OkStatus() : Ask(stubs);
}

}  // namespace pepeseg
