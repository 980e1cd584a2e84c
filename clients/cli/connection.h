#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"

namespace pepeseg::cli {

// A server's services.
struct Connection {
  explicit Connection(const std::shared_ptr<grpc::Channel>& channel);

  std::unique_ptr<v1::SceneService::Stub> scenes;
  std::unique_ptr<v1::DatasetService::Stub> datasets;
  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::SegmentationService::Stub> segmentation;
};

// The context of one call: carries the scene as routing key "x-scene" ("" for none) and ends the
// call after `seconds` (0: never, for streams that last as long as a job).
class Call {
 public:
  Call(const std::string& scene, double seconds);
  operator grpc::ClientContext*() { return &context_; }  // NOLINT(google-explicit-constructor)

 private:
  grpc::ClientContext context_;
};

constexpr double kCallSeconds = 120;  // the first question to a model loads it

// "shelf" or "scenes/shelf" -> "scenes/shelf"; likewise jobs.
std::string SceneName(const std::string& scene);
std::string JobName(const std::string& job);

// "scenes/shelf/models/3" -> "scenes/shelf".
std::string SceneOf(const std::string& resource);

// Random, so that a call repeated after a lost answer is known for the same one.
std::string NewRequestId();

// The newest sealed dataset of a scene; FAILED_PRECONDITION when it has none.
absl::StatusOr<v1::Dataset> NewestDataset(const Connection& connection, const std::string& scene);

// Every view of a model, by name.
absl::StatusOr<std::vector<v1::View>> AllViews(const Connection& connection,
                                               const std::string& model);

}  // namespace pepeseg::cli
