// The queue's side of the store: claims, and writes of an attempt under its fence.
#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/database.h"
#include "server/jobs/store.h"
#include "server/jobs/store_sql.h"

namespace pepeseg {
namespace {

// An attempt that lost its claim must change nothing.
absl::StatusOr<JobRow> SelectAttempt(soci::session& sql, const std::string& id, int64_t fence) {
  ASSIGN_OR_RETURN(JobRow job, SelectJob(sql, id));
  if (job.state == JobState::kRunning && job.fence == fence) return job;
  return absl::AbortedError(absl::StrCat("jobs/", id, " is no longer run as attempt ", fence));
}

// Writes what the queue may change of a job.
void UpdateJob(soci::session& sql, const JobRow& job) {
  const int state = static_cast<int>(job.state);
  const int cancel_requested = job.cancel_requested ? 1 : 0;
  const int64_t start_time = ToMicros(job.start_time);
  const int64_t end_time = ToMicros(job.end_time);
  sql << "UPDATE jobs SET state = :state, stage = :stage, device = :device, fence = :fence,"
         " cancel_requested = :c,"
         " error_code = :code, error_message = :message, model = :model, start_time = :start,"
         " end_time = :end WHERE number = :number",
      soci::use(state), soci::use(job.stage), soci::use(job.device), soci::use(job.fence),
      soci::use(cancel_requested), soci::use(job.error_code), soci::use(job.error_message),
      soci::use(job.model), soci::use(start_time), soci::use(end_time), soci::use(job.number);
}

void MarkCancelled(JobRow& job) {
  job.state = JobState::kCancelled;
  job.error_code = static_cast<int>(absl::StatusCode::kCancelled);
  job.error_message = "cancelled on request";
  job.end_time = absl::Now();
}

}  // namespace

absl::StatusOr<std::optional<JobRow>> Store::ClaimJob(const std::string& device) {
  using Claimed = std::optional<JobRow>;
  return database_->Query<Claimed>([&](soci::session& sql) -> absl::StatusOr<Claimed> {
    std::vector<JobRow> queued =
        SelectJobs(sql, "state = :queued ORDER BY number", static_cast<int>(JobState::kQueued), 1);
    if (queued.empty()) return Claimed();
    JobRow job = queued[0];
    job.state = JobState::kRunning;
    job.stage.clear();
    job.device = device;
    job.fence += 1;
    job.start_time = absl::Now();
    UpdateJob(sql, job);
    return Claimed(std::move(job));
  });
}

absl::StatusOr<std::vector<JobRow>> Store::ListRunningJobs() {
  using Jobs = std::vector<JobRow>;
  return database_->Query<Jobs>([](soci::session& sql) -> absl::StatusOr<Jobs> {
    constexpr int64_t kAll = int64_t{1} << 40;
    return SelectJobs(sql, "state = :running ORDER BY number", static_cast<int>(JobState::kRunning),
                      kAll);
  });
}

absl::Status Store::SetJobStage(const std::string& id, int64_t fence, const std::string& stage) {
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(JobRow job, SelectAttempt(sql, id, fence));
    job.stage = stage;
    UpdateJob(sql, job);
    return absl::OkStatus();
  });
}

absl::StatusOr<JobRow> Store::RequestCancel(const std::string& id) {
  return database_->Query<JobRow>([&](soci::session& sql) -> absl::StatusOr<JobRow> {
    ASSIGN_OR_RETURN(JobRow job, SelectJob(sql, id));
    if (IsTerminal(job.state)) return job;
    job.cancel_requested = true;
    if (job.state == JobState::kQueued) MarkCancelled(job);
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<JobRow> Store::RequeueJob(const std::string& id, int64_t fence) {
  return database_->Query<JobRow>([&](soci::session& sql) -> absl::StatusOr<JobRow> {
    ASSIGN_OR_RETURN(JobRow job, SelectAttempt(sql, id, fence));
    job.state = JobState::kQueued;
    job.stage.clear();
    job.start_time = absl::InfinitePast();
    if (job.cancel_requested) MarkCancelled(job);
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<JobRow> Store::EndJob(const std::string& id, int64_t fence,
                                     const absl::Status& error) {
  return database_->Query<JobRow>([&](soci::session& sql) -> absl::StatusOr<JobRow> {
    ASSIGN_OR_RETURN(JobRow job, SelectAttempt(sql, id, fence));
    job.state = JobState::kFailed;
    job.error_code = static_cast<int>(error.code());
    job.error_message = std::string(error.message());
    job.end_time = absl::Now();
    if (absl::IsCancelled(error)) MarkCancelled(job);
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<ModelRow> Store::CommitModel(const std::string& id, int64_t fence,
                                            const ModelRow& model) {
  return database_->Query<ModelRow>([&](soci::session& sql) -> absl::StatusOr<ModelRow> {
    ASSIGN_OR_RETURN(JobRow job, SelectAttempt(sql, id, fence));
    ModelRow row = model;
    row.scene = job.scene;
    row.job = job.id;
    row.device = job.device;
    row.number = TakeNumber(sql, job.scene, "next_model");
    row.create_time = absl::Now();
    const int64_t now = ToMicros(row.create_time);
    sql << "INSERT INTO models (scene, number, job, device, folder, metrics, sources, "
           "num_gaussians,"
           " num_bytes, create_time) VALUES (:scene, :number, :job, :device, :folder, :metrics, "
           ":sources, :count, :bytes, :now)",
        soci::use(row.scene), soci::use(row.number), soci::use(row.job), soci::use(row.device),
        soci::use(row.folder), soci::use(row.metrics), soci::use(row.sources),
        soci::use(row.num_gaussians), soci::use(row.num_bytes), soci::use(now);
    job.state = JobState::kSucceeded;
    job.model = row.number;
    job.end_time = row.create_time;
    UpdateJob(sql, job);
    return row;
  });
}

}  // namespace pepeseg
