#pragma once

#include <grpcpp/grpcpp.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tests/server/call.h"

namespace pepeseg::testing {

struct ClientFile {
  std::string path;
  v1::FileKind kind = v1::FILE_KIND_IMAGE;
  std::string bytes;
};

// Reads a folder with the layout of core/dataset/import.h into memory.
std::vector<ClientFile> ReadDataset(const std::filesystem::path& folder);
// Returns the file with that path. Fails the test if there is none.
ClientFile& FileOf(std::vector<ClientFile>& files, const std::string& path);

// A client of the contract with blocking calls.
class ServiceClient {
 public:
  explicit ServiceClient(std::shared_ptr<grpc::Channel> channel) : channel_(std::move(channel)) {}

  absl::Status CreateScene(const std::string& id);
  absl::StatusOr<v1::Upload> CreateUpload(const std::string& scene,
                                          const std::vector<ClientFile>& files);
  // Sends files. Stops after `max_bytes` and closes the connection.
  absl::Status WriteFiles(const v1::Upload& upload, const std::vector<ClientFile>& files,
                          size_t max_bytes = SIZE_MAX);
  // Sends bytes [range.first, range.second) of one file, and completes the file if they reach its
  // end. Otherwise waits for the server to end the stream.
  absl::Status SendFrom(const v1::Upload& upload, const ClientFile& file,
                        std::pair<int64_t, int64_t> range);
  absl::StatusOr<v1::Upload> GetUpload(const std::string& name);
  absl::StatusOr<v1::Dataset> SealUpload(const std::string& name);
  // Uploads and seals the files, and returns the dataset's name.
  absl::StatusOr<std::string> Upload(const std::string& scene,
                                     const std::vector<ClientFile>& files);

  absl::StatusOr<v1::Job> Train(const std::string& scene, const std::string& dataset,
                                const v1::TrainingOptions& options);
  absl::StatusOr<v1::Job> GetJob(const std::string& name);
  absl::StatusOr<v1::Job> CancelJob(const std::string& name);
  // Returns all events from the first on, until the server ends the stream.
  absl::StatusOr<std::vector<v1::JobEvent>> Watch(const std::string& name);
  // Waits until the job has ended, and returns it.
  absl::StatusOr<v1::Job> WaitForJob(const std::string& name);
  // Waits until the job has reported a step, and returns it.
  absl::StatusOr<v1::Job> WaitForStep(const std::string& name);

  absl::StatusOr<v1::Model> GetModel(const std::string& name);
  absl::StatusOr<v1::EstimateTrainingResponse> Estimate(const std::string& scene,
                                                        const std::string& dataset,
                                                        const v1::TrainingOptions& options);
  absl::StatusOr<std::vector<v1::View>> ListViews(const std::string& model);
  absl::StatusOr<v1::SegmentViewsResponse> Segment(const v1::SegmentViewsRequest& request);
  absl::StatusOr<v1::RenderViewResponse> Render(const std::string& model, const std::string& view);
  // Exports a model, checks the digest, and returns the PLY.
  absl::StatusOr<std::string> Export(const std::string& model);

 private:
  std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace pepeseg::testing
