#include "clients/cpp/client.h"

#include <chrono>
#include <optional>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/border_requests.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

using Scenes = v1::SceneService::Stub;
using Jobs = v1::JobService::Stub;
using Segmentation = v1::SegmentationService::Stub;
using Labels = v1::LabelService::Stub;
using Selections = v1::SelectionService::Stub;
using Editing = v1::EditService::Stub;
using Rendering = v1::RenderService::Stub;
using Evaluation = v1::EvaluationService::Stub;

constexpr int kMaxWatchRetries = 10;  // in a row without an event
constexpr auto kRetryPause = std::chrono::seconds(3);
constexpr double kEvaluateSeconds = 3600;  // a hundred entities take long on a CPU

// Returns the request that has only a name.
template <class Request>
Request Named(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

// Returns true for a final state.
bool HasEnded(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
}

// How much of a job has been seen, over all streams.
struct Watched {
  std::optional<int64_t> after = {};     // where the first stream starts, as in WatchJobRequest
  std::optional<int64_t> sequence = {};  // of the last event; empty before the first
  bool ended = false;                    // the last state seen was a final one
};

// Reads one stream to its end. It resumes after the last event of `watched`, which it updates.
absl::Status WatchOnce(Jobs& jobs, const std::string& job, Watched& watched,
                       absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  v1::WatchJobRequest request;
  request.set_name(job);
  const std::optional<int64_t> after = watched.sequence ? watched.sequence : watched.after;
  if (after) request.set_after_sequence(*after);
  // No deadline: a job may run for hours. The scene of a job is not in its name.
  Call call("", 0);
  auto stream = jobs.WatchJob(call, request);
  v1::JobEvent event;
  while (stream->Read(&event)) {
    // A heartbeat has the number of the newest event before it, so it counts, too.
    watched.sequence = event.sequence();
    if (event.event_case() == v1::JobEvent::kHeartbeat) continue;
    watched.ended |= event.event_case() == v1::JobEvent::kStateChanged &&
                     HasEnded(event.state_changed().state());
    watched.ended |=
        event.event_case() == v1::JobEvent::kSnapshot && HasEnded(event.snapshot().state());
    on_event(event);
  }
  return FromGrpc(stream->Finish());
}

// Reads the stream of one edit to its end.
absl::StatusOr<v1::EditModelResponse::Result> EditOnce(
    Editing& editing, const v1::EditModelRequest& request,
    absl::FunctionRef<void(const v1::EditModelResponse::Progress&)> on_progress) {
  // No deadline: on a CPU a hole takes a minute, after the edits that are waiting.
  Call call(SceneOf(request.model()), 0);
  auto stream = editing.EditModel(call, request);
  std::optional<v1::EditModelResponse::Result> result;
  v1::EditModelResponse part;
  while (stream->Read(&part)) {
    if (part.has_progress()) on_progress(part.progress());
    if (part.has_result()) result = part.result();
  }
  RETURN_IF_ERROR(FromGrpc(stream->Finish()));
  if (!result) return absl::InternalError("the edit ended without a result");
  return *std::move(result);
}

// Returns true for an error of the connection, after which a watch is resumed.
bool IsAway(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsDeadlineExceeded(status);
}

}  // namespace

Client::Client(const std::shared_ptr<grpc::Channel>& channel)
    : scenes_(v1::SceneService::NewStub(channel)),
      datasets_(v1::DatasetService::NewStub(channel)),
      jobs_(v1::JobService::NewStub(channel)),
      segmentation_(v1::SegmentationService::NewStub(channel)),
      labels_(v1::LabelService::NewStub(channel)),
      selections_(v1::SelectionService::NewStub(channel)),
      editing_(v1::EditService::NewStub(channel)),
      rendering_(v1::RenderService::NewStub(channel)),
      evaluation_(v1::EvaluationService::NewStub(channel)) {}

absl::Status Client::EnsureScene(const std::string& scene) const {
  // A scene can be created by its id only, in the caller's project.
  if (absl::StartsWith(scene, "projects/")) return GetScene(scene).status();
  v1::CreateSceneRequest request;
  // The id, without "scenes/".
  request.set_scene_id(SceneName(scene).substr(std::string("scenes/").size()));
  // An id makes a repeated request harmless: the server answers it as it did the first time.
  request.set_request_id(NewRequestId());
  const absl::Status status = Ask(*scenes_, &Scenes::CreateScene, scene, request).status();
  return absl::IsAlreadyExists(status) ? absl::OkStatus() : status;
}

absl::StatusOr<v1::Scene> Client::GetScene(const std::string& scene) const {
  return Ask(*scenes_, &Scenes::GetScene, scene, Named<v1::GetSceneRequest>(SceneName(scene)));
}

absl::StatusOr<v1::ListScenesResponse> Client::ListScenes() const {
  return AskAllPages(*scenes_, &Scenes::ListScenes, "", v1::ListScenesRequest());
}

absl::Status Client::DeleteScene(const std::string& scene) const {
  return Ask(*scenes_, &Scenes::DeleteScene, scene, Named<v1::DeleteSceneRequest>(SceneName(scene)))
      .status();
}

absl::StatusOr<v1::Model> Client::GetModel(const std::string& model) const {
  return Ask(*scenes_, &Scenes::GetModel, SceneOf(model), Named<v1::GetModelRequest>(model));
}

absl::StatusOr<v1::ListModelsResponse> Client::ListModels(const std::string& scene) const {
  v1::ListModelsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*scenes_, &Scenes::ListModels, scene, request);
}

absl::Status Client::DeleteModel(const std::string& model) const {
  return Ask(*scenes_, &Scenes::DeleteModel, SceneOf(model), Named<v1::DeleteModelRequest>(model))
      .status();
}

absl::StatusOr<v1::Scene> Client::SetLiveModel(const std::string& model) const {
  return Ask(*scenes_, &Scenes::SetLiveModel, SceneOf(model),
             Named<v1::SetLiveModelRequest>(model));
}

absl::StatusOr<std::vector<v1::View>> Client::ListViews(const std::string& model) const {
  v1::ListViewsRequest request;
  request.set_parent(model);
  ASSIGN_OR_RETURN(const v1::ListViewsResponse all,
                   AskAllPages(*scenes_, &Scenes::ListViews, SceneOf(model), request));
  return std::vector<v1::View>(all.views().begin(), all.views().end());
}

absl::StatusOr<v1::Job> Client::Train(v1::TrainSceneRequest request) const {
  request.set_scene(SceneName(request.scene()));
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*jobs_, &Jobs::TrainScene, request.scene(), request);
}

absl::StatusOr<v1::EstimateTrainingResponse> Client::EstimateTraining(
    const v1::EstimateTrainingRequest& request) const {
  return Ask(*jobs_, &Jobs::EstimateTraining, request.scene(), request);
}

absl::StatusOr<v1::ListTrainingOptionsResponse> Client::ListTrainingOptions(
    const v1::ListTrainingOptionsRequest& request) const {
  return Ask(*jobs_, &Jobs::ListTrainingOptions, "", request);
}

absl::StatusOr<v1::Job> Client::GetJob(const std::string& job) const {
  return Ask(*jobs_, &Jobs::GetJob, "", Named<v1::GetJobRequest>(JobName(job)));
}

absl::StatusOr<v1::ListJobsResponse> Client::ListJobs(const std::string& scene) const {
  v1::ListJobsRequest request;
  if (!scene.empty()) request.set_scene(SceneName(scene));
  return AskAllPages(*jobs_, &Jobs::ListJobs, scene, request);
}

absl::StatusOr<v1::Job> Client::CancelJob(const std::string& job) const {
  return Ask(*jobs_, &Jobs::CancelJob, "", Named<v1::CancelJobRequest>(JobName(job)));
}

absl::StatusOr<v1::Job> Client::WatchJob(const std::string& job,
                                         absl::FunctionRef<void(const v1::JobEvent&)> on_event,
                                         const std::function<void()>& on_break,
                                         std::optional<int64_t> after) const {
  Watched watched = {.after = after};
  for (int failures = 0; !watched.ended;) {
    const std::optional<int64_t> before = watched.sequence;
    const absl::Status status = WatchOnce(*jobs_, JobName(job), watched, on_event);
    if (watched.ended || status.ok()) break;
    if (watched.sequence != before) failures = 0;  // the stream had brought something
    // Before the first event an error is returned at once.
    if (!IsAway(status) || !watched.sequence || ++failures > kMaxWatchRetries) return status;
    if (on_break) on_break();
    std::this_thread::sleep_for(kRetryPause);
  }
  return GetJob(job);
}

absl::StatusOr<v1::SegmentViewsResponse> Client::Segment(
    const v1::SegmentViewsRequest& request) const {
  const auto ask = [this](const v1::SegmentViewsRequest& piece) {
    return Ask(*segmentation_, &Segmentation::SegmentViews, SceneOf(piece.model()), piece);
  };
  if (!request.sam_borders() && !request.sam_clicks()) return ask(request);
  std::vector<v1::View> views;
  if (request.targets().group() != v1::SegmentViewsRequest::Targets::GROUP_UNSPECIFIED) {
    ASSIGN_OR_RETURN(views, ListViews(request.model()));
  }
  std::vector<v1::SegmentViewsRequest> pieces = PiecesOf(request, views);
  ASSIGN_OR_RETURN(v1::SegmentViewsResponse whole, ask(pieces.front()));
  for (size_t i = 1; i < pieces.size(); ++i) {
    // A new training does not mix its masks with those of the old one.
    pieces[i].set_model(whole.model());
    ASSIGN_OR_RETURN(const v1::SegmentViewsResponse piece, ask(pieces[i]));
    AddPiece(piece, whole);
  }
  return whole;
}

absl::StatusOr<v1::ProposeScalesResponse> Client::ProposeScales(
    const v1::ProposeScalesRequest& request) const {
  return Ask(*segmentation_, &Segmentation::ProposeScales, SceneOf(request.model()), request);
}

absl::StatusOr<v1::FindSegmentsResponse> Client::Find(
    const v1::FindSegmentsRequest& request) const {
  return Ask(*segmentation_, &Segmentation::FindSegments, SceneOf(request.model()), request);
}

absl::StatusOr<v1::DecomposeModelResponse> Client::Decompose(
    const v1::DecomposeModelRequest& request) const {
  return Ask(*segmentation_, &Segmentation::DecomposeModel, SceneOf(request.model()), request);
}

absl::StatusOr<v1::CorrectSegmentResponse> Client::Correct(
    const v1::CorrectSegmentRequest& request) const {
  return Ask(*segmentation_, &Segmentation::CorrectSegment, SceneOf(request.model()), request);
}

absl::StatusOr<v1::EditModelResponse::Result> Client::Edit(
    const v1::EditModelRequest& request,
    absl::FunctionRef<void(const v1::EditModelResponse::Progress&)> on_progress) const {
  const RetryBudget retries(kCallSeconds);
  while (true) {
    bool has_begun = false;
    auto result = EditOnce(*editing_, request, [&](const auto& progress) {
      has_begun = true;
      on_progress(progress);
    });
    // A stream that the server puts off has sent nothing.
    if (result.ok() || has_begun || !retries.WaitAfter(result.status())) return result;
  }
}

absl::StatusOr<v1::EvaluateModelResponse> Client::Evaluate(
    const v1::EvaluateModelRequest& request) const {
  return Ask(*evaluation_, &Evaluation::EvaluateModel, SceneOf(request.model()), request,
             kEvaluateSeconds);
}

absl::StatusOr<v1::RenderViewResponse> Client::Render(const v1::RenderViewRequest& request) const {
  return Ask(*rendering_, &Rendering::RenderView, SceneOf(request.model()), request);
}

absl::StatusOr<v1::Label> Client::CreateLabel(v1::CreateLabelRequest request) const {
  request.set_parent(SceneName(request.parent()));
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*labels_, &Labels::CreateLabel, request.parent(), request);
}

absl::StatusOr<v1::Label> Client::GetLabel(const std::string& label, v1::PixelFrame frame) const {
  v1::GetLabelRequest request;
  request.set_name(label);
  request.set_frame(frame);
  return Ask(*labels_, &Labels::GetLabel, SceneOf(label), request);
}

absl::StatusOr<v1::ListLabelsResponse> Client::ListLabels(const std::string& scene) const {
  v1::ListLabelsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*labels_, &Labels::ListLabels, scene, request);
}

absl::Status Client::DeleteLabel(const std::string& label) const {
  return Ask(*labels_, &Labels::DeleteLabel, SceneOf(label), Named<v1::DeleteLabelRequest>(label))
      .status();
}

absl::StatusOr<v1::Selection> Client::Select(v1::CreateSelectionRequest request) const {
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*selections_, &Selections::CreateSelection, SceneOf(request.model()), request);
}

absl::StatusOr<v1::Selection> Client::CombineSelections(
    v1::CombineSelectionsRequest request) const {
  if (request.request_id().empty()) request.set_request_id(NewRequestId());
  return Ask(*selections_, &Selections::CombineSelections, SceneOf(request.first()), request);
}

absl::StatusOr<v1::Selection> Client::UndoSelection(const std::string& selection) const {
  return Ask(*selections_, &Selections::UndoSelection, SceneOf(selection),
             Named<v1::UndoSelectionRequest>(selection));
}

absl::StatusOr<v1::Selection> Client::GetSelection(const std::string& selection,
                                                   bool want_gaussians) const {
  auto request = Named<v1::GetSelectionRequest>(selection);
  request.set_want_gaussians(want_gaussians);
  return Ask(*selections_, &Selections::GetSelection, SceneOf(selection), request);
}

absl::StatusOr<v1::ListSelectionsResponse> Client::ListSelections(const std::string& scene) const {
  v1::ListSelectionsRequest request;
  request.set_parent(SceneName(scene));
  return AskAllPages(*selections_, &Selections::ListSelections, scene, request);
}

absl::Status Client::DeleteSelection(const std::string& selection) const {
  return Ask(*selections_, &Selections::DeleteSelection, SceneOf(selection),
             Named<v1::DeleteSelectionRequest>(selection))
      .status();
}

}  // namespace pepeseg::client
