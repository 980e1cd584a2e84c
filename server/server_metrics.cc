#include "server/server_metrics.h"

#include "core/base/status_macros.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "server/server_gauges.h"

namespace pepeseg {
namespace {

std::vector<std::string> MeasuredServices() {
  std::vector<std::string> names = ServiceNames();
  names.emplace_back(v1::AdminService::service_full_name());
  return names;
}

}  // namespace

const std::vector<std::string>& ServiceNames() {
  static const std::vector<std::string> names = {
      v1::SceneService::service_full_name(), v1::DatasetService::service_full_name(),
      v1::JobService::service_full_name(), v1::SegmentationService::service_full_name()};
  return names;
}

ServerMetrics::ServerMetrics()
    : rpc_(std::make_shared<RpcMetrics>(MeasuredServices())),
      jobs_(std::make_shared<JobMetrics>()) {}

absl::Status ServerMetrics::Expose(const std::string& listen, const Operations& operations) {
  ASSIGN_OR_RETURN(exposition_, Exposition::Start(listen));
  gauges_ = std::make_shared<ServerGauges>(operations);
  jobs_->SetRunning([supervisor = operations.context().supervisor](const std::string& job) {
    return supervisor->FindRunning(job).has_value();
  });
  exposition_->Add(rpc_);
  exposition_->Add(jobs_);
  exposition_->Add(gauges_);
  return absl::OkStatus();
}

}  // namespace pepeseg
