#include "server/server_metrics.h"

#include <prometheus/collectable.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/edit_service.grpc.pb.h"
#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/render_service.grpc.pb.h"
#include "pepeseg/v1/scene_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/observe/process_use.h"
#include "server/rpc/stream_registry.h"

namespace pepeseg {
namespace {

// Returns the names of all services, with the admin service.
std::vector<std::string> MeasuredServices() {
  std::vector<std::string> names = ServiceNames();
  names.emplace_back(v1::AdminService::service_full_name());
  return names;
}

template <typename Number>
double Value(Number number) {
  return static_cast<double>(number);
}

// The values that a server reads at the moment when Prometheus asks for them, so that nothing has
// to keep them up to date. Collect() blocks on the store.
class ServerGauges final : public prometheus::Collectable {
 public:
  explicit ServerGauges(const Operations& operations) : operations_(operations) {}

  std::vector<prometheus::MetricFamily> Collect() const override;

 private:
  void AddServer(Samples& samples) const;
  void AddPools(Samples& samples) const;
  void AddRows(Samples& samples) const;
  void AddModels(Samples& samples) const;
  void AddDevices(Samples& samples) const;
  void AddProcess(Samples& samples) const;

  const Operations& operations_;
};

std::vector<prometheus::MetricFamily> ServerGauges::Collect() const {
  std::vector<prometheus::MetricFamily> families;
  Samples samples(families);
  AddServer(samples);
  AddPools(samples);
  AddRows(samples);
  AddModels(samples);
  AddDevices(samples);
  AddProcess(samples);
  return families;
}

void ServerGauges::AddServer(Samples& samples) const {
  const StreamRegistry& streams = operations_.runner().streams();
  samples.Gauge("pepeseg_build_info", "Version and device of the server; always 1.");
  samples.Add(1, {{"version", Operations::version()}, {"device", operations_.DeviceNames()}});
  samples.Gauge("pepeseg_draining", "1 while the server refuses new work.");
  samples.Add(operations_.health().draining() ? 1 : 0);
  samples.Gauge("pepeseg_service_healthy", "1 while health reports SERVING.");
  for (const auto& [service, serving] : operations_.health().serving()) {
    samples.Add(serving ? 1 : 0, {{"service", service.empty() ? "server" : service}});
  }
  samples.Gauge("pepeseg_streams_open", "Streaming calls in progress.");
  samples.Add(Value(streams.size()));
  samples.Gauge("pepeseg_streams_limit", "Maximum number of open streams.");
  samples.Add(Value(streams.limits().max_streams));
  samples.Counter("pepeseg_streams_refused_total", "Streams refused: too many, or draining.");
  samples.Add(Value(streams.num_refused()));
  samples.Gauge("pepeseg_disk_free_bytes", "Free bytes of the data directory's file system.");
  samples.Add(Value(DiskFreeBytes(operations_.models().data_folder())));
}

void ServerGauges::AddPools(Samples& samples) const {
  const WorkerPools& all = operations_.runner().pools();
  const std::array<std::pair<const char*, WorkerPool::Use>, 8> pools = {
      {{"io", all.io.use()},
       {"upload", all.upload.use()},
       {"query", all.query.use()},
       {"evaluation", all.evaluation.use()},
       {"correction", all.correction.use()},
       {"find", all.find.use()},
       {"border", all.border.use()},
       {"admin", all.admin.use()}}};
  const auto add = [&](auto value) {
    for (const auto& [name, use] : pools) samples.Add(Value(value(use)), {{"pool", name}});
  };
  using Use = WorkerPool::Use;
  samples.Gauge("pepeseg_pool_threads", "Threads of the pool.");
  add([](const Use& use) { return use.num_threads; });
  samples.Gauge("pepeseg_pool_busy_threads", "Threads of the pool that run a task.");
  add([](const Use& use) { return use.num_busy; });
  samples.Gauge("pepeseg_pool_queued_calls", "Calls that wait for a thread.");
  add([](const Use& use) { return use.num_queued; });
  samples.Gauge("pepeseg_pool_queue_limit_calls",
                "Maximum number of calls that wait for a thread.");
  add([](const Use& use) { return use.max_queued; });
  samples.Counter("pepeseg_pool_refused_calls_total", "Calls refused because the queue was full.");
  add([](const Use& use) { return use.num_refused; });
}

void ServerGauges::AddRows(Samples& samples) const {
  // If the database does not answer, the families stay empty.
  const auto counts = operations_.models().store().CountAll();
  samples.Gauge("pepeseg_jobs", "Jobs in the database, of all servers on it.");
  if (counts.ok()) {
    constexpr std::array kStates = {
        std::pair{JobState::kQueued, "queued"}, std::pair{JobState::kRunning, "running"},
        std::pair{JobState::kSucceeded, "succeeded"}, std::pair{JobState::kFailed, "failed"},
        std::pair{JobState::kCancelled, "cancelled"}};
    for (const auto& [state, name] : kStates) {
      const auto found = counts->jobs.find(state);
      samples.Add(found == counts->jobs.end() ? 0 : Value(found->second), {{"state", name}});
    }
  }
  samples.Gauge("pepeseg_scenes", "Scenes in the database.");
  if (counts.ok()) samples.Add(Value(counts->num_scenes));
  samples.Gauge("pepeseg_models", "Models in the database.");
  if (counts.ok()) samples.Add(Value(counts->num_models));
}

void ServerGauges::AddModels(Samples& samples) const {
  const ModelLoader& loader = operations_.models();
  const std::vector<ModelDevice>& devices = loader.devices().all();
  const auto add = [&](auto value) {
    for (const ModelDevice& device : devices) {
      samples.Add(Value(value(device)), {{"device", device.id}});
    }
  };
  const auto add_memories = [&](auto bytes) {
    for (const ModelDevice& device : devices) {
      const MemoryBytes both = bytes(*device.cache);
      samples.Add(Value(both.host), {{"device", device.id}, {"memory", "host"}});
      if (device.cache->budget().one_memory()) continue;
      samples.Add(Value(both.device), {{"device", device.id}, {"memory", "device"}});
    }
  };
  samples.Gauge("pepeseg_resident_models", "Models in memory.");
  add([](const ModelDevice& device) {
    int64_t num_models = 0;
    device.cache->Visit([&](const ModelCache::Info&, const SceneModel&) { ++num_models; });
    return num_models;
  });
  samples.Gauge("pepeseg_resident_reserved_bytes", "Memory reserved for models, bytes.");
  add_memories([](const ModelCache& models) { return models.bytes_in_use(); });
  samples.Gauge("pepeseg_resident_limit_bytes",
                "Maximum of the memory reserved for models, bytes.");
  add_memories([](const ModelCache& models) { return models.budget().usable(); });
  samples.Gauge("pepeseg_device_used_bytes",
                "Device memory allocated by models and queries, bytes.");
  add([](const ModelDevice& device) { return device.backend.bytes_in_use(); });
  samples.Counter("pepeseg_model_loads_total", "Models loaded into memory.");
  add([](const ModelDevice& device) { return device.cache->counts().num_loads; });
  samples.Counter("pepeseg_model_evictions_total", "Models evicted to make room.");
  add([](const ModelDevice& device) { return device.cache->counts().num_evictions; });
  samples.Counter("pepeseg_feature_map_hits_total", "Feature maps of views found in the cache.");
  samples.Add(Value(loader.map_counts().num_hits.load()));
  samples.Counter("pepeseg_feature_map_renders_total", "Feature maps that had to be rendered.");
  samples.Add(Value(loader.map_counts().num_renders.load()));
}

void ServerGauges::AddDevices(Samples& samples) const {
  const std::vector<DeviceUse::Use> uses = operations_.supervisor().device_use();
  const std::vector<ModelDevice>& devices = operations_.models().devices().all();
  samples.Counter("pepeseg_device_job_seconds_total", "Time in which jobs ran on the device.");
  for (size_t i = 0; i < devices.size(); ++i) {
    samples.Add(absl::ToDoubleSeconds(uses[i].job_time), {{"device", devices[i].id}});
  }
}

void ServerGauges::AddProcess(Samples& samples) const {
  const ProcessUse use = MeasureProcess();
  samples.Gauge("pepeseg_process_resident_bytes", "Resident memory of the server, bytes.");
  samples.Add(Value(use.resident_bytes));
  samples.Gauge("pepeseg_process_open_descriptors", "Open file descriptors of the server.");
  samples.Add(use.num_descriptors);
  samples.Gauge("pepeseg_process_max_descriptors", "Maximum number of open file descriptors.");
  samples.Add(Value(use.max_descriptors));
  samples.Gauge("pepeseg_process_threads", "Threads of the server.");
  samples.Add(use.num_threads);
  samples.Counter("pepeseg_process_cpu_seconds_total", "CPU time that the server has used.");
  samples.Add(absl::ToDoubleSeconds(use.cpu_time));
  samples.Gauge("pepeseg_process_start_time_seconds",
                "Start time of the server, seconds since 1970.");
  samples.Add(absl::ToDoubleSeconds(operations_.start_time() - absl::UnixEpoch()));
}

}  // namespace

const std::vector<std::string>& ServiceNames() {
  static const std::vector<std::string> names = {
      v1::SceneService::service_full_name(),     v1::DatasetService::service_full_name(),
      v1::JobService::service_full_name(),       v1::SegmentationService::service_full_name(),
      v1::LabelService::service_full_name(),     v1::SelectionService::service_full_name(),
      v1::EditService::service_full_name(),      v1::RenderService::service_full_name(),
      v1::EvaluationService::service_full_name()};
  return names;
}

ServerMetrics::ServerMetrics()
    : rpc_(std::make_shared<RpcMetrics>(MeasuredServices())),
      jobs_(std::make_shared<JobMetrics>()) {}

absl::Status ServerMetrics::Expose(const std::string& listen, const Operations& operations) {
  ASSIGN_OR_RETURN(exposition_, Exposition::Start(listen));
  gauges_ = std::make_shared<ServerGauges>(operations);
  jobs_->SetRunning([&supervisor = operations.supervisor()](const std::string& job) {
    return supervisor.FindRunning(job).has_value();
  });
  exposition_->Add(rpc_);
  exposition_->Add(jobs_);
  exposition_->Add(gauges_);
  return absl::OkStatus();
}

}  // namespace pepeseg
