#include "server/services/operations.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <vector>

#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"
#include "server/observe/process_use.h"
#include "server/rpc/stream_registry.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxJobs = 1000;  // in a status

void FillPool(v1::ServerStatus::Work work, const WorkerPool& pool, v1::ServerStatus* response) {
  const WorkerPool::Use use = pool.use();
  v1::ServerStatus::Pool& to = *response->add_pools();
  to.set_work(work);
  to.set_num_threads(use.num_threads);
  to.set_num_busy(use.num_busy);
  to.set_num_queued(static_cast<int32_t>(use.num_queued));
  to.set_max_queued(static_cast<int32_t>(use.max_queued));
}

}  // namespace

Operations::Operations(const Dependencies& deps) : deps_(deps), start_time_(absl::Now()) {}

std::string Operations::version() { return PEPESEG_VERSION; }

void Operations::SetDraining(bool draining) {
  const std::lock_guard lock(draining_mutex_);
  if (deps_.health.draining() != draining) {
    spdlog::info(draining ? "draining: nothing new is taken" : "no longer draining");
  }
  // Health first, so that no call is refused while health still reports SERVING.
  deps_.health.SetDraining(draining);
  deps_.runner.pools().SetDraining(draining);
  deps_.runner.streams().SetDraining(draining);
  draining ? deps_.supervisor.StopClaiming() : deps_.supervisor.ResumeClaiming();
}

void Operations::FillProcess(v1::ServerStatus* response) const {
  const ProcessUse use = MeasureProcess();
  response->set_resident_bytes(use.resident_bytes);
  response->set_num_descriptors(use.num_descriptors);
  response->set_num_threads(use.num_threads);
  response->set_disk_free_bytes(DiskFreeBytes(deps_.models.data_folder()));
}

std::string Operations::DeviceNames() const {
  std::vector<std::string> names;
  for (const ModelDevice& device : deps_.models.devices().all()) names.push_back(device.name);
  return absl::StrJoin(names, ", ");
}

void Operations::FillDevices(v1::ServerStatus* response) const {
  // Both lists are in the order of --devices.
  const std::vector<DeviceUse::Use> uses = deps_.supervisor.device_use();
  const std::vector<ModelDevice>& devices = deps_.models.devices().all();
  for (size_t i = 0; i < devices.size(); ++i) {
    const ModelCache& models = *devices[i].cache;
    const bool one_memory = models.budget().one_memory();
    const MemoryBytes used = models.bytes_in_use(), limit = models.budget().usable();
    int num_models = 0;
    models.Visit([&](const ModelCache::Info&, const SceneModel&) { ++num_models; });
    v1::ServerStatus::Device& to = *response->add_devices();
    to.set_id(devices[i].id);
    to.set_name(devices[i].name);
    if (!uses[i].job.empty()) to.set_job(JobName(uses[i].job));
    *to.mutable_job_time() = ToProto(uses[i].job_time);
    to.set_num_models(num_models);
    to.set_model_bytes(one_memory ? used.host : used.device);
    to.set_model_limit_bytes(one_memory ? limit.host : limit.device);
  }
}

absl::Status Operations::FillJobs(v1::ServerStatus* response) const {
  Store& store = deps_.models.store();
  ASSIGN_OR_RETURN(const std::vector<JobRecord> running, store.queue().ListRunningJobs());
  for (size_t i = 0; i < std::min(running.size(), kMaxJobs); ++i) {
    v1::Job& job = *response->add_running_jobs();
    job = ToProto(running[i]);
    // Jobs of other servers that share the database have no progress here.
    const auto newest = deps_.supervisor.FindRunning(running[i].id);
    if (newest && newest->progress) *job.mutable_progress() = *newest->progress;
  }
  ASSIGN_OR_RETURN(Store::Counts counts, store.CountAll());
  response->set_num_queued_jobs(counts.jobs[JobState::kQueued]);
  return absl::OkStatus();
}

absl::Status Operations::FillStatus(v1::ServerStatus* response) const {
  const WorkerPools& pools = deps_.runner.pools();
  response->set_version(version());
  response->set_device(DeviceNames());
  FillDevices(response);
  *response->mutable_start_time() = ToProto(start_time_);
  response->set_draining(deps_.health.draining());
  FillProcess(response);
  FillPool(v1::ServerStatus::WORK_IO, pools.io, response);
  FillPool(v1::ServerStatus::WORK_QUERY, pools.query, response);
  FillPool(v1::ServerStatus::WORK_EVALUATION, pools.evaluation, response);
  FillPool(v1::ServerStatus::WORK_UPLOAD, pools.upload, response);
  FillPool(v1::ServerStatus::WORK_BORDER, pools.border, response);
  FillPool(v1::ServerStatus::WORK_CORRECTION, pools.correction, response);
  FillPool(v1::ServerStatus::WORK_FIND, pools.find, response);
  *response->mutable_find_sources() = deps_.find_sources;
  response->set_num_streams(static_cast<int32_t>(deps_.runner.streams().size()));
  const LatencyWindow::Quantiles queries = LatencyWindow::Summarize(
      absl::Now(), pools.query.latencies(), pools.evaluation.latencies(), pools.find.latencies());
  response->set_queries_per_second(queries.per_second);
  *response->mutable_query_p50() = ToProto(queries.p50);
  *response->mutable_query_p99() = ToProto(queries.p99);
  return FillJobs(response);
}

}  // namespace pepeseg
