#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

namespace pepeseg::testing {

struct ClientFile {
  std::string path;
  v1::FileKind kind = v1::FILE_KIND_IMAGE;
  std::string bytes;
};

// A folder laid out as core/dataset/import.h says, in memory.
std::vector<ClientFile> ReadDataset(const std::filesystem::path& folder);
// The file of that path; a test that asks for another fails.
ClientFile& FileOf(std::vector<ClientFile>& files, const std::string& path);

// What a client of the contract does, blocking, with plain answers.
class ServiceClient {
 public:
  explicit ServiceClient(const std::shared_ptr<grpc::Channel>& channel);

  absl::Status CreateScene(const std::string& id);
  absl::StatusOr<v1::Upload> CreateUpload(const std::string& scene,
                                          const std::vector<ClientFile>& files);
  // Sends the files named, as they are; stops after `max_bytes` and hangs up.
  absl::Status WriteFiles(const v1::Upload& upload, const std::vector<ClientFile>& files,
                          size_t max_bytes = SIZE_MAX);
  // Of one file the bytes [range.first, range.second); those up to its end with the end. When that
  // is not the file's, it waits for the server to hang up.
  absl::Status SendFrom(const v1::Upload& upload, const ClientFile& file,
                        std::pair<int64_t, int64_t> range);
  absl::StatusOr<v1::Upload> GetUpload(const std::string& name);
  absl::StatusOr<v1::Dataset> SealUpload(const std::string& name);
  // All of it: the dataset's name.
  absl::StatusOr<std::string> Upload(const std::string& scene,
                                     const std::vector<ClientFile>& files);

  absl::StatusOr<v1::Job> Train(const std::string& scene, const std::string& dataset,
                                const v1::TrainingOptions& options);
  absl::StatusOr<v1::Job> GetJob(const std::string& name);
  absl::StatusOr<v1::Job> CancelJob(const std::string& name);
  // From the first event on, until the server ends the stream.
  absl::StatusOr<std::vector<v1::JobEvent>> Watch(const std::string& name);
  // The job, once it has ended.
  absl::StatusOr<v1::Job> WaitForJob(const std::string& name);
  // The job, once it has told of a step.
  absl::StatusOr<v1::Job> WaitForStep(const std::string& name);

  absl::StatusOr<v1::Model> GetModel(const std::string& name);
  absl::StatusOr<v1::EstimateTrainingResponse> Estimate(const std::string& scene,
                                                        const std::string& dataset,
                                                        const v1::TrainingOptions& options);
  absl::StatusOr<std::vector<v1::View>> ListViews(const std::string& model);
  absl::StatusOr<v1::SegmentResponse> Segment(const v1::SegmentRequest& request);
  absl::StatusOr<v1::RenderResponse> Render(const std::string& model, const std::string& view);
  // The PLY, once its digest was found right.
  absl::StatusOr<std::string> Export(const std::string& model);

 private:
  std::unique_ptr<v1::SceneService::Stub> scenes_;
  std::unique_ptr<v1::DatasetService::Stub> datasets_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation_;
};

}  // namespace pepeseg::testing
