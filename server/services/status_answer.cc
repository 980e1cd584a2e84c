#include "server/services/status_answer.h"

#include <algorithm>

#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/api/rows_to_proto.h"
#include "server/observe/process_use.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxJobs = 1000;

void FillPool(const char* name, const WorkerPool& pool, v1::ServerStatus* response) {
  const WorkerPool::Use use = pool.use();
  v1::ServerStatus::Pool& to = *response->add_pools();
  to.set_name(name);
  to.set_num_threads(use.num_threads);
  to.set_num_busy(use.num_busy);
  to.set_num_queued(static_cast<int32_t>(use.num_queued));
  to.set_max_queued(static_cast<int32_t>(use.max_queued));
}

void FillProcess(const ServiceContext& context, v1::ServerStatus* response) {
  const ProcessUse use = MeasureProcess();
  response->set_resident_bytes(use.resident_bytes);
  response->set_num_descriptors(use.num_descriptors);
  response->set_num_threads(use.num_threads);
  response->set_disk_free_bytes(DiskFreeBytes(context.data_folder));
}

absl::Status FillJobs(const ServiceContext& context, v1::ServerStatus* response) {
  ASSIGN_OR_RETURN(const std::vector<JobRow> running, context.store->queue().ListRunningJobs());
  for (size_t i = 0; i < std::min(running.size(), kMaxJobs); ++i) {
    v1::Job& job = *response->add_running_jobs();
    job = ToProto(running[i]);
    const auto newest = context.supervisor->FindRunning(running[i].id);
    if (newest && newest->progress) *job.mutable_progress() = *newest->progress;
  }
  ASSIGN_OR_RETURN(Store::Counts counts, context.store->CountAll());
  response->set_num_queued_jobs(counts.jobs[JobState::kQueued]);
  return absl::OkStatus();
}

}  // namespace

absl::Status AnswerStatus(const Operations& operations, v1::ServerStatus* response) {
  const ServiceContext& context = operations.context();
  response->set_version(Operations::version());
  response->set_device(context.backend->name());
  *response->mutable_start_time() = ToProto(operations.start_time());
  response->set_draining(operations.health().draining());
  FillProcess(context, response);
  FillPool("io", *context.pool, response);
  FillPool("query", *context.query_pool, response);
  FillPool("evaluation", *context.evaluation_pool, response);
  FillPool("upload", *context.upload_pool, response);
  response->set_num_streams(static_cast<int32_t>(context.streams->size()));
  const LatencyWindow::Quantiles queries = LatencyWindow::Summarize(
      absl::Now(), context.query_pool->latencies(), context.evaluation_pool->latencies());
  response->set_queries_per_second(queries.per_second);
  *response->mutable_query_p50() = ToProto(queries.p50);
  *response->mutable_query_p99() = ToProto(queries.p99);
  return FillJobs(context, response);
}

absl::Status AnswerDrain(Operations& operations, const v1::DrainRequest& request,
                         v1::ServerStatus* response) {
  operations.SetDraining(request.draining());
  return AnswerStatus(operations, response);
}

}  // namespace pepeseg
