#include "server/server_health.h"

#include <string>
#include <utility>
#include <vector>

#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "server/observe/health_monitor.h"
#include "server/server_metrics.h"

namespace pepeseg {

std::unique_ptr<HealthMonitor> MakeHealthMonitor(const ServiceContext& context) {
  std::vector<std::string> services = ServiceNames();
  services.emplace_back("");
  std::vector<HealthMonitor::Probe> probes;
  probes.push_back({"database", [store = context.store] { return store->Ping(); }, services});
  probes.push_back(
      {"data directory",
       [folder = context.data_folder] { return ProbeDisk(folder, kMinDiskFreeBytes); },
       {v1::DatasetService::service_full_name(), v1::JobService::service_full_name()}});
  probes.push_back({"device",
                    [backend = context.backend] { return ProbeDevice(*backend); },
                    {v1::SegmentationService::service_full_name(), ""},
                    /*blocks=*/false});
  return std::make_unique<HealthMonitor>(std::move(services), std::move(probes));
}

}  // namespace pepeseg
