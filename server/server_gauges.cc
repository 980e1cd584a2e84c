#include "server/server_gauges.h"

#include <array>
#include <string>
#include <utility>

#include "server/observe/process_use.h"

namespace pepeseg {
namespace {

template <typename Number>
double Value(Number number) {
  return static_cast<double>(number);
}

}  // namespace

std::vector<prometheus::MetricFamily> ServerGauges::Collect() const {
  std::vector<prometheus::MetricFamily> families;
  Samples samples(families);
  AddServer(samples);
  AddPools(samples);
  AddRows(samples);
  AddModels(samples);
  AddProcess(samples);
  return families;
}

void ServerGauges::AddServer(Samples& samples) const {
  const ServiceContext& context = operations_.context();
  samples.Gauge("pepeseg_build_info", "Which program runs, on what device; always 1.");
  samples.Add(1, {{"version", Operations::version()}, {"device", context.backend->name()}});
  samples.Gauge("pepeseg_draining", "1 while the server takes nothing new.");
  samples.Add(operations_.health().draining() ? 1 : 0);
  samples.Gauge("pepeseg_service_healthy", "1 while health says SERVING.");
  for (const auto& [service, serving] : operations_.health().serving()) {
    samples.Add(serving ? 1 : 0, {{"service", service.empty() ? "server" : service}});
  }
  samples.Gauge("pepeseg_streams_open", "Streaming calls under way.");
  samples.Add(Value(context.streams->size()));
  samples.Gauge("pepeseg_streams_limit", "How many may be.");
  samples.Add(Value(context.streams->limits().max_streams));
  samples.Counter("pepeseg_streams_refused_total", "Streams refused: too many, or draining.");
  samples.Add(Value(context.streams->num_refused()));
  samples.Gauge("pepeseg_disk_free_bytes", "Of the data directory's file system.");
  samples.Add(Value(DiskFreeBytes(context.data_folder)));
}

void ServerGauges::AddPools(Samples& samples) const {
  const ServiceContext& context = operations_.context();
  const std::array<std::pair<const char*, WorkerPool::Use>, 4> pools = {
      {{"io", context.pool->use()},
       {"upload", context.upload_pool->use()},
       {"query", context.query_pool->use()},
       {"evaluation", context.evaluation_pool->use()}}};
  const auto add = [&](auto value) {
    for (const auto& [name, use] : pools) samples.Add(Value(value(use)), {{"pool", name}});
  };
  using Use = WorkerPool::Use;
  samples.Gauge("pepeseg_pool_threads", "Threads for calls.");
  add([](const Use& use) { return use.num_threads; });
  samples.Gauge("pepeseg_pool_busy_threads", "Of them, those that work.");
  add([](const Use& use) { return use.num_busy; });
  samples.Gauge("pepeseg_pool_queued_calls", "Calls that wait for a thread.");
  add([](const Use& use) { return use.num_queued; });
  samples.Gauge("pepeseg_pool_queue_limit_calls", "How many may.");
  add([](const Use& use) { return use.max_queued; });
  samples.Counter("pepeseg_pool_refused_calls_total", "Calls refused because as many waited.");
  add([](const Use& use) { return use.num_refused; });
}

void ServerGauges::AddRows(Samples& samples) const {
  // While the database does not answer there are no samples.
  const auto counts = operations_.context().store->CountAll();
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
  const ServiceContext& context = operations_.context();
  const ModelCache& models = *context.models;
  int64_t num_models = 0;
  models.Visit([&](const ModelCache::Info&, const Segmenter&) { ++num_models; });
  const MemoryBytes used = models.bytes_in_use(), limit = models.budget().usable();
  const bool two = !models.budget().one_memory();
  samples.Gauge("pepeseg_resident_models", "Models in memory.");
  samples.Add(Value(num_models));
  samples.Gauge("pepeseg_resident_reserved_bytes", "Reserved for them.");
  samples.Add(Value(used.host), {{"memory", "host"}});
  if (two) samples.Add(Value(used.device), {{"memory", "device"}});
  samples.Gauge("pepeseg_resident_limit_bytes", "That may be reserved.");
  samples.Add(Value(limit.host), {{"memory", "host"}});
  if (two) samples.Add(Value(limit.device), {{"memory", "device"}});
  samples.Gauge("pepeseg_device_used_bytes", "Allocated on the device by models and questions.");
  samples.Add(Value(context.backend->bytes_in_use()));
  const ModelCache::Counts counts = models.counts();
  samples.Counter("pepeseg_model_loads_total", "Models loaded into memory.");
  samples.Add(Value(counts.num_loads));
  samples.Counter("pepeseg_model_evictions_total", "Models evicted to make room.");
  samples.Add(Value(counts.num_evictions));
  samples.Counter("pepeseg_feature_map_hits_total", "Feature maps of views that were kept.");
  samples.Add(Value(context.map_counts->num_hits.load()));
  samples.Counter("pepeseg_feature_map_renders_total", "Feature maps that had to be rendered.");
  samples.Add(Value(context.map_counts->num_renders.load()));
}

void ServerGauges::AddProcess(Samples& samples) const {
  const ProcessUse use = MeasureProcess();
  samples.Gauge("pepeseg_process_resident_bytes", "Resident memory of the server.");
  samples.Add(Value(use.resident_bytes));
  samples.Gauge("pepeseg_process_open_descriptors", "Its open file descriptors.");
  samples.Add(use.num_descriptors);
  samples.Gauge("pepeseg_process_max_descriptors", "How many it may open.");
  samples.Add(Value(use.max_descriptors));
  samples.Gauge("pepeseg_process_threads", "Its threads.");
  samples.Add(use.num_threads);
  samples.Counter("pepeseg_process_cpu_seconds_total", "Processor time that it has used.");
  samples.Add(absl::ToDoubleSeconds(use.cpu_time));
  samples.Gauge("pepeseg_process_start_time_seconds", "When it started, since 1970.");
  samples.Add(absl::ToDoubleSeconds(operations_.start_time() - absl::UnixEpoch()));
}

}  // namespace pepeseg
