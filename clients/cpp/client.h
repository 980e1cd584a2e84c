#pragma once

#include <grpcpp/channel.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "clients/cpp/dataset_folder.h"
#include "clients/cpp/upload_progress.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

// A pepeseg server as C++ programs use it; `pepeseg`, the command line, is such a program.
namespace pepeseg::client {

// Over a channel of OpenChannel (clients/cpp/channel.h). Calls block; an object may be shared by
// threads. Scenes and jobs are named "shelf" or "scenes/shelf", "j3" or "jobs/j3"; models
// "scenes/shelf/models/live" (ModelName). Requests without a request_id are given one.
//
// Errors are the server's, with its ErrorDetail (DetailOf, clients/cpp/answer_status.h):
// UNAVAILABLE when none answers, DEADLINE_EXCEEDED after two minutes (Evaluate: an hour).
class Client {
 public:
  explicit Client(const std::shared_ptr<grpc::Channel>& channel);

  // Scenes and models (client_scenes.cc).
  absl::Status EnsureScene(const std::string& scene) const;  // makes it unless it is there
  absl::StatusOr<v1::Scene> GetScene(const std::string& scene) const;
  absl::StatusOr<v1::ListScenesResponse> ListScenes() const;
  absl::Status DeleteScene(const std::string& scene) const;
  absl::StatusOr<v1::Model> GetModel(const std::string& model) const;
  absl::StatusOr<v1::ListModelsResponse> ListModels(const std::string& scene) const;
  absl::Status DeleteModel(const std::string& model) const;
  absl::StatusOr<std::vector<v1::View>> ListViews(const std::string& model) const;

  // Datasets (client_uploads.cc). Declares the files, sends what the server does not have of them,
  // seals. Goes on with an upload of the same files that was broken off, and after a lost
  // connection until nothing has come through for a minute. DATA_LOSS: a file changed meanwhile.
  absl::StatusOr<v1::Dataset> Upload(const std::string& scene, const DatasetFolder& folder,
                                     const UploadProgress& progress = {}) const;
  // The newest sealed one; FAILED_PRECONDITION when there is none.
  absl::StatusOr<v1::Dataset> NewestDataset(const std::string& scene) const;
  // A photograph of a dataset or a model. DATA_LOSS: its bytes fail their checksum.
  struct Photograph {
    v1::GetPhotographResponse::Header header;
    std::string bytes;  // an image file of header.content_type()
  };
  absl::StatusOr<Photograph> GetPhotograph(const v1::GetPhotographRequest& request) const;

  // Jobs (client_jobs.cc).
  absl::StatusOr<v1::Job> Train(v1::TrainSceneRequest request) const;
  absl::StatusOr<v1::EstimateTrainingResponse> EstimateTraining(
      const v1::EstimateTrainingRequest& request) const;
  absl::StatusOr<v1::Job> GetJob(const std::string& job) const;
  absl::StatusOr<v1::ListJobsResponse> ListJobs(const std::string& scene = "") const;
  absl::StatusOr<v1::Job> CancelJob(const std::string& job) const;
  // Follows a job to its end and returns it as it ended: succeeded, failed or cancelled. Every
  // event is seen once, heartbeats are left out. Asks again for half a minute when the server goes
  // away; `on_break`, if any, is told so.
  absl::StatusOr<v1::Job> WatchJob(const std::string& job,
                                   absl::FunctionRef<void(const v1::JobEvent&)> on_event,
                                   const std::function<void()>& on_break = nullptr) const;

  // Questions to a model (client_questions.cc).
  absl::StatusOr<v1::SegmentResponse> Segment(const v1::SegmentRequest& request) const;
  absl::StatusOr<v1::ProposeScalesResponse> ProposeScales(
      const v1::ProposeScalesRequest& request) const;
  absl::StatusOr<v1::DecomposeResponse> Decompose(const v1::DecomposeRequest& request) const;
  absl::StatusOr<v1::EvaluateResponse> Evaluate(const v1::EvaluateRequest& request) const;
  absl::StatusOr<v1::RenderResponse> Render(const v1::RenderRequest& request) const;
  // A model, or a subset of it, as a PLY: checked, and put in `file`'s place only when it is whole.
  absl::StatusOr<v1::ExportSelectionResponse::Header> Export(
      const v1::ExportSelectionRequest& request, const std::string& file) const;

  // Labels and selections (client_selections.cc), by their names.
  absl::StatusOr<v1::Label> CreateLabel(v1::CreateLabelRequest request) const;
  absl::StatusOr<v1::ListLabelsResponse> ListLabels(const std::string& scene) const;
  absl::Status DeleteLabel(const std::string& label) const;
  absl::StatusOr<v1::Selection> Select(v1::SelectRequest request) const;
  absl::StatusOr<v1::Selection> CombineSelections(v1::CombineSelectionsRequest request) const;
  absl::StatusOr<v1::Selection> UndoSelection(const std::string& selection) const;
  absl::StatusOr<v1::Selection> GetSelection(const std::string& selection) const;
  absl::StatusOr<v1::ListSelectionsResponse> ListSelections(const std::string& scene) const;
  absl::Status DeleteSelection(const std::string& selection) const;

 private:
  std::unique_ptr<v1::SceneService::Stub> scenes_;
  std::unique_ptr<v1::DatasetService::Stub> datasets_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation_;
};

}  // namespace pepeseg::client
