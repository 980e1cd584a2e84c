#pragma once

#include <grpcpp/channel.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "clients/cpp/dataset_folder.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/edit_service.grpc.pb.h"
#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/render_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"

// The client library of C++ programs; `pepeseg`, the command line, is such a program.
namespace pepeseg::client {

// Callbacks of an upload, called on the thread that uploads. Either may be empty.
struct UploadProgress {
  // `num_there` of the `num_bytes` bytes of the dataset are on the server.
  std::function<void(int64_t num_there, int64_t num_bytes)> bytes;
  // A sentence for a person: the upload was interrupted and is repeated, or nothing is to be sent.
  std::function<void(const std::string& what)> note;
};

// Calls the services of a pepeseg server. Methods block; an object may be shared by threads.
//
// A scene is named "shelf" or "scenes/shelf", a job "j3" or "jobs/j3", a model by its resource
// name, such as "scenes/shelf/models/live" (see ModelName in clients/cpp/resource_names.h).
// Requests without a request_id get a random one.
//
// Errors are those of the server, with its details (see DetailOf in clients/cpp/answer_status.h).
// UNAVAILABLE: no server answers. DEADLINE_EXCEEDED: no answer within two minutes (Evaluate: an
// hour).
class Client {
 public:
  // `channel` comes from OpenChannel (clients/cpp/channel.h).
  explicit Client(const std::shared_ptr<grpc::Channel>& channel);

  // Scenes and models.

  // Creates the scene unless it exists. A scene whose name has its project, "projects/P/scenes/S",
  // is not created. NOT_FOUND: that scene does not exist.
  absl::Status EnsureScene(const std::string& scene) const;
  absl::StatusOr<v1::Scene> GetScene(const std::string& scene) const;
  absl::StatusOr<v1::ListScenesResponse> ListScenes() const;
  absl::Status DeleteScene(const std::string& scene) const;
  absl::StatusOr<v1::Model> GetModel(const std::string& model) const;
  absl::StatusOr<v1::ListModelsResponse> ListModels(const std::string& scene) const;
  absl::Status DeleteModel(const std::string& model) const;
  // Makes a model the live one of its scene, and returns the scene.
  absl::StatusOr<v1::Scene> SetLiveModel(const std::string& model) const;
  absl::StatusOr<std::vector<v1::View>> ListViews(const std::string& model) const;

  // Datasets (client_uploads.cc).

  // Declares the files of `folder`, sends the bytes that the server lacks, and seals the dataset.
  // Resumes an earlier upload of the same files if one was interrupted. After a lost connection it
  // retries until no byte has arrived for a minute. DATA_LOSS: a file changed during the upload.
  absl::StatusOr<v1::Dataset> Upload(const std::string& scene, const DatasetFolder& folder,
                                     const UploadProgress& progress = {}) const;
  // Deletes an upload that is not sealed, with the bytes that were sent of it.
  absl::Status DeleteUpload(const std::string& upload) const;
  absl::StatusOr<v1::Dataset> GetDataset(const std::string& dataset) const;
  absl::StatusOr<v1::ListDatasetsResponse> ListDatasets(const std::string& scene) const;
  // Returns the newest sealed dataset of the scene; FAILED_PRECONDITION if it has none.
  absl::StatusOr<v1::Dataset> NewestDataset(const std::string& scene) const;
  struct Photograph {
    v1::GetPhotographResponse::Header header;
    std::string bytes;  // an image file of type header.content_type()
  };
  // Returns a photograph of a dataset or a model. DATA_LOSS: the stored file fails its
  // SHA-256, or bytes are missing.
  absl::StatusOr<Photograph> GetPhotograph(const v1::GetPhotographRequest& request) const;

  // Jobs.

  absl::StatusOr<v1::Job> Train(v1::TrainSceneRequest request) const;
  absl::StatusOr<v1::EstimateTrainingResponse> EstimateTraining(
      const v1::EstimateTrainingRequest& request) const;
  absl::StatusOr<v1::ListTrainingOptionsResponse> ListTrainingOptions(
      const v1::ListTrainingOptionsRequest& request) const;
  absl::StatusOr<v1::Job> GetJob(const std::string& job) const;
  absl::StatusOr<v1::ListJobsResponse> ListJobs(const std::string& scene = "") const;
  absl::StatusOr<v1::Job> CancelJob(const std::string& job) const;
  // Follows a job to its end and returns the ended job: succeeded, failed or cancelled. Calls
  // `on_event` once for each event except heartbeats. If the connection breaks after the first
  // event, calls `on_break`, if there is one, and retries every 3 seconds, for half a minute.
  // after: as WatchJobRequest.after_sequence; 0 replays all events.
  absl::StatusOr<v1::Job> WatchJob(const std::string& job,
                                   absl::FunctionRef<void(const v1::JobEvent&)> on_event,
                                   const std::function<void()>& on_break = nullptr,
                                   std::optional<int64_t> after = std::nullopt) const;

  // Queries of a model.

  // With sam_borders, requests 8 views at a time (clients/cpp/border_requests.h) and returns one
  // response. The model that answers first answers for all views.
  absl::StatusOr<v1::SegmentViewsResponse> Segment(const v1::SegmentViewsRequest& request) const;
  absl::StatusOr<v1::ProposeScalesResponse> ProposeScales(
      const v1::ProposeScalesRequest& request) const;
  absl::StatusOr<v1::FindSegmentsResponse> Find(const v1::FindSegmentsRequest& request) const;
  absl::StatusOr<v1::DecomposeModelResponse> Decompose(
      const v1::DecomposeModelRequest& request) const;
  // Makes a new model, which is live. A call whose response was lost is not repeated.
  absl::StatusOr<v1::CorrectSegmentResponse> Correct(
      const v1::CorrectSegmentRequest& request) const;
  // Makes a new model by one edit of Gaussians, which is live. Calls `on_progress` while a hole is
  // filled. An edit whose result was lost is not repeated.
  absl::StatusOr<v1::EditModelResponse::Result> Edit(
      const v1::EditModelRequest& request,
      absl::FunctionRef<void(const v1::EditModelResponse::Progress&)> on_progress) const;
  absl::StatusOr<v1::EvaluateModelResponse> Evaluate(const v1::EvaluateModelRequest& request) const;
  absl::StatusOr<v1::RenderViewResponse> Render(const v1::RenderViewRequest& request) const;
  // Writes a model, or a subset of it, to `file`. The file appears only once all of its
  // bytes are there and match their SHA-256; otherwise: DATA_LOSS.
  absl::StatusOr<v1::ExportGaussiansResponse::Header> Export(
      const v1::ExportGaussiansRequest& request, const std::string& file) const;
  // Does the same with a mesh of it, which the server makes in seconds.
  absl::StatusOr<v1::ExportMeshResponse::Header> ExportMesh(const v1::ExportMeshRequest& request,
                                                            const std::string& file) const;

  // Labels and selections; arguments and results have resource names.

  absl::StatusOr<v1::Label> CreateLabel(v1::CreateLabelRequest request) const;
  // Returns a label with its mask, in the pixels of `frame`.
  absl::StatusOr<v1::Label> GetLabel(const std::string& label, v1::PixelFrame frame) const;
  absl::StatusOr<v1::ListLabelsResponse> ListLabels(const std::string& scene) const;
  // Exports the masks of the labels in views as a zip with the files of an annotation tool, to
  // `file` as Export does. Calls `on_progress` now and then before.
  absl::StatusOr<v1::ExportAnnotationsResponse::Header> ExportAnnotations(
      const v1::ExportAnnotationsRequest& request, const std::string& file,
      absl::FunctionRef<void(const v1::ExportAnnotationsResponse::Progress&)> on_progress) const;
  absl::Status DeleteLabel(const std::string& label) const;
  absl::StatusOr<v1::Selection> Select(v1::CreateSelectionRequest request) const;
  absl::StatusOr<v1::Selection> CombineSelections(v1::CombineSelectionsRequest request) const;
  absl::StatusOr<v1::Selection> UndoSelection(const std::string& selection) const;
  // want_gaussians: as GetSelectionRequest.want_gaussians.
  absl::StatusOr<v1::Selection> GetSelection(const std::string& selection,
                                             bool want_gaussians = false) const;
  absl::StatusOr<v1::ListSelectionsResponse> ListSelections(const std::string& scene) const;
  absl::Status DeleteSelection(const std::string& selection) const;

 private:
  std::unique_ptr<v1::SceneService::Stub> scenes_;
  std::unique_ptr<v1::DatasetService::Stub> datasets_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation_;
  std::unique_ptr<v1::LabelService::Stub> labels_;
  std::unique_ptr<v1::SelectionService::Stub> selections_;
  std::unique_ptr<v1::EditService::Stub> editing_;
  std::unique_ptr<v1::RenderService::Stub> rendering_;
  std::unique_ptr<v1::EvaluationService::Stub> evaluation_;
};

}  // namespace pepeseg::client
