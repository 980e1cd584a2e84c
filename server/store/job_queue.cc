#include "server/store/job_queue.h"

#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
constexpr int64_t kAll = int64_t{1} << 40;  // limit of a SELECT that returns everything
// Time back from now within which a project's use of devices counts against it.
constexpr absl::Duration kShareWindow = absl::Hours(1);
// Time after which a queued job is claimed as if it were a preview, so that a stream of previews
// stops no other job for ever.
constexpr absl::Duration kLongWait = absl::Minutes(10);

// Returns the job of an attempt, or ABORTED if the attempt has lost its claim.
absl::StatusOr<JobRecord> SelectAttempt(soci::session& sql, const std::string& id, int64_t fence,
                                        const JobQueue::Holder& holder) {
  ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, id));
  // All three are needed: the fence is that of a later attempt if the job was claimed again, and
  // the owner is another server if the attempt itself was taken over.
  if (job.state == JobState::kRunning && job.fence == fence && job.lease_owner == holder.name) {
    return job;
  }
  return absl::AbortedError(
      absl::StrCat("jobs/", id, " is no longer run as attempt ", fence, " by this server"));
}

// Writes the columns of a job that the queue may change. All functions below read the job, change
// it in memory and write it back, in one serializable transaction: two servers that change the same
// job collide, and one of them runs again and sees the other's change.
void UpdateJob(soci::session& sql, const JobRecord& job) {
  const int state = static_cast<int>(job.state);
  const int cancel_requested = job.cancel_requested ? 1 : 0;
  const int64_t lease_end = ToMicros(job.lease_end);
  const int64_t not_before = ToMicros(job.not_before);
  const int64_t start_time = ToMicros(job.start_time);
  const int64_t end_time = ToMicros(job.end_time);
  sql << "UPDATE jobs SET state = :state, stage = :stage, device = :device, fence = :fence,"
         " lease_owner = :owner, lease_end = :lease, launch = :launch, crashes = :crashes,"
         " server_ends = :server_ends, put_backs = :put_backs, not_before = :not_before, "
         "cancel_requested = :c,"
         " error_code = :code, error_message = :message, model = :model, start_time = :start,"
         " end_time = :end WHERE number = :number",
      soci::use(state), soci::use(job.stage), soci::use(job.device), soci::use(job.fence),
      soci::use(job.lease_owner), soci::use(lease_end), soci::use(job.launch),
      soci::use(job.crashes), soci::use(job.server_ends), soci::use(job.put_backs),
      soci::use(not_before), soci::use(cancel_requested), soci::use(job.error_code),
      soci::use(job.error_message), soci::use(job.model), soci::use(start_time),
      soci::use(end_time), soci::use(job.number);
}

void MarkCancelled(JobRecord& job) {
  job.state = JobState::kCancelled;
  job.error_code = static_cast<int>(absl::StatusCode::kCancelled);
  job.error_message = "cancelled on request";
  job.end_time = absl::Now();
}

// Clears what belongs to the holder of a job.
void EndClaim(JobRecord& job) {
  job.lease_owner.clear();
  job.lease_end = absl::InfinitePast();
  job.launch.clear();
}

// Starts the next attempt of a job.
// The fence numbers the attempts of a job: files and events of each attempt carry it, so that a
// worker of an earlier one that still runs cannot be taken for this one.
void BeginClaim(JobRecord& job, const std::string& device) {
  job.state = JobState::kRunning;
  job.stage.clear();
  job.device = device;
  job.fence += 1;
  job.not_before = absl::InfinitePast();
  job.start_time = absl::Now();
}

// Updates the counters by which the supervisor decides that a job has failed too often.
// Progress resets both counters: a long job may be interrupted any number of times as long as each
// attempt gets further.
void CountAttempt(const EndedAttempt& attempt, JobRecord& job) {
  if (attempt.end == AttemptEnd::kPutBack) job.put_backs += 1;
  if (attempt.progress) {
    job.crashes = job.server_ends = 0;
  } else if (attempt.end == AttemptEnd::kCrashed) {
    job.crashes += 1;
  } else if (attempt.end == AttemptEnd::kServerEnded) {
    job.server_ends += 1;
  }
}

// Leases are measured by the database's clock: the clocks of the servers may differ.
int64_t LeaseEnd(soci::session& sql, const JobQueue::Holder& holder) {
  if (holder.lease == absl::InfiniteDuration()) return kNever;
  return DatabaseMicros(sql) + absl::ToInt64Microseconds(holder.lease);
}

// Returns the numbers of the jobs to claim, first those to claim first, at most `limit`. With
// `locked` no other transaction claims them meanwhile, and PostgreSQL skips jobs that other servers
// are claiming at the moment, instead of waiting for them.
//
// The quota of running jobs applies to QUEUED jobs only: a RUNNING job whose lease has expired
// counts in its project already. The subquery of the quota selects the projects that run as many
// jobs as they may: `most` for those without a value of their own.
//
// `shares` has what each project runs now, and how long its jobs ran within kShareWindow. The time
// of a job counts from the start of its newest attempt, which is all that the store keeps.
std::vector<int64_t> SelectClaimable(soci::session& sql, const Quota& defaults,
                                     JobQueue::Claims claims, int limit, bool locked) {
  // SQLite has no row locks; its transactions are IMMEDIATE, so that claims follow one another.
  const std::string lock =
      locked && sql.get_backend_name() == "postgresql" ? " FOR UPDATE OF jobs SKIP LOCKED" : "";
  const int64_t now = DatabaseMicros(sql);
  const int64_t since = now - absl::ToInt64Microseconds(kShareWindow);
  const int64_t long_ago = now - absl::ToInt64Microseconds(kLongWait);
  const int64_t expired = claims == JobQueue::Claims::kAll ? now : 0;
  const int least_preview = claims == JobQueue::Claims::kPreviews ? 1 : 0;
  const int64_t most = defaults.running_jobs > 0 ? defaults.running_jobs : kNever;
  int64_t number = 0;
  soci::statement select =
      (sql.prepare
           << "SELECT jobs.number FROM jobs JOIN scenes ON scenes.id = jobs.scene LEFT JOIN ("
              "SELECT s.project AS project, SUM(CASE WHEN r.state = 1 THEN 1 ELSE 0 END)"
              " AS running, SUM(CASE WHEN r.state = 1 THEN :now1 ELSE r.end_time END -"
              " CASE WHEN r.start_time > :since1 THEN r.start_time ELSE :since2 END) AS used"
              " FROM jobs r JOIN scenes s ON s.id = r.scene"
              " WHERE r.start_time > 0 AND (r.state = 1 OR r.end_time > :since3) GROUP BY s.project"
              ") shares ON shares.project = scenes.project"
              " WHERE (jobs.state = 1 AND jobs.lease_end < :expired) OR (jobs.state = 0 AND"
              " jobs.preview >= :least_preview AND jobs.not_before <= :now3"
              " AND scenes.project NOT IN (SELECT s.project FROM jobs r JOIN scenes s ON s.id = "
              "r.scene"
              " LEFT JOIN projects p ON p.id = s.project WHERE r.state = 1 GROUP BY s.project"
              " HAVING COUNT(*) >= COALESCE(NULLIF(MAX(p.running_jobs), 0), :most)))"
              " ORDER BY CASE WHEN jobs.state = 1 THEN 0 WHEN jobs.put_backs > 0 THEN 1"
              " WHEN jobs.preview = 1 OR jobs.create_time < :long_ago THEN 2 ELSE 3 END,"
              " COALESCE(shares.running, 0),"
              " COALESCE(shares.used, 0), jobs.number LIMIT :limit"
           << lock,
       soci::use(now), soci::use(since), soci::use(since), soci::use(since), soci::use(expired),
       soci::use(least_preview), soci::use(now), soci::use(most), soci::use(long_ago),
       soci::use(limit), soci::into(number));
  select.execute();
  std::vector<int64_t> numbers;
  while (select.fetch()) numbers.push_back(number);
  return numbers;
}

// Returns the number of the job to claim, or 0.
int64_t SelectNext(soci::session& sql, const Quota& defaults, JobQueue::Claims claims) {
  const std::vector<int64_t> next = SelectClaimable(sql, defaults, claims, 1, /*locked=*/true);
  return next.empty() ? 0 : next.front();
}

std::vector<JobRecord> SelectRunning(soci::session& sql) {
  return SelectJobs(sql, "state = :running ORDER BY number", static_cast<int>(JobState::kRunning),
                    kAll);
}

std::vector<JobRecord> SelectHeld(soci::session& sql, const JobQueue::Holder& holder) {
  std::vector<JobRecord> jobs = SelectRunning(sql);
  std::erase_if(jobs, [&](const JobRecord& job) { return job.lease_owner != holder.name; });
  return jobs;
}

}  // namespace

absl::StatusOr<std::optional<JobRecord>> JobQueue::ClaimJob(const std::string& device,
                                                            Claims claims) {
  using Claimed = std::optional<JobRecord>;
  return database_.Query<Claimed>([&](soci::session& sql) -> absl::StatusOr<Claimed> {
    const int64_t number = SelectNext(sql, defaults_, claims);
    if (number == 0) return Claimed();
    ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, absl::StrCat("j", number)));
    // A launcher still runs the others: their attempt continues under a new holder.
    // A RUNNING job is claimed only after its lease has expired, when the worker of its old holder
    // has ended by itself (heartbeat.h).
    if (job.launch.empty()) BeginClaim(job, device);
    job.lease_owner = holder_.name;
    job.lease_end = FromMicros(LeaseEnd(sql, holder_));
    UpdateJob(sql, job);
    return Claimed(std::move(job));
  });
}

absl::StatusOr<std::string> JobQueue::FindPreview() {
  return database_.Query<std::string>([&](soci::session& sql) -> absl::StatusOr<std::string> {
    const int64_t number = SelectNext(sql, defaults_, Claims::kPreviews);
    return number == 0 ? std::string() : absl::StrCat("j", number);
  });
}

absl::StatusOr<std::vector<int64_t>> JobQueue::ListClaimable() {
  using Numbers = std::vector<int64_t>;
  return database_.Query<Numbers>([&](soci::session& sql) -> absl::StatusOr<Numbers> {
    return SelectClaimable(sql, defaults_, Claims::kQueued, kMostListed, /*locked=*/false);
  });
}

absl::StatusOr<std::vector<JobRecord>> JobQueue::RenewLeases() {
  using Jobs = std::vector<JobRecord>;
  return database_.Query<Jobs>([this](soci::session& sql) -> absl::StatusOr<Jobs> {
    const int64_t lease_end = LeaseEnd(sql, holder_);
    // Renews by owner, without a condition on the time: a lease that has expired but that nobody
    // has claimed is still this server's. What another server has claimed is missing from the
    // answer.
    sql << "UPDATE jobs SET lease_end = :lease WHERE state = 1 AND lease_owner = :owner",
        soci::use(lease_end), soci::use(holder_.name);
    return SelectHeld(sql, holder_);
  });
}

absl::StatusOr<std::vector<JobRecord>> JobQueue::ListHeldJobs() {
  using Jobs = std::vector<JobRecord>;
  return database_.Query<Jobs>(
      [this](soci::session& sql) -> absl::StatusOr<Jobs> { return SelectHeld(sql, holder_); });
}

absl::StatusOr<std::vector<JobRecord>> JobQueue::ListRunningJobs() {
  using Jobs = std::vector<JobRecord>;
  return database_.Query<Jobs>(
      [](soci::session& sql) -> absl::StatusOr<Jobs> { return SelectRunning(sql); });
}

absl::StatusOr<JobRecord> JobQueue::TakeOverJob(const std::string& id, const std::string& gone) {
  return database_.Query<JobRecord>([&](soci::session& sql) -> absl::StatusOr<JobRecord> {
    ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, id));
    // Two servers may both find that the holder is gone: the second one finds the first one's name
    // here.
    if (job.state != JobState::kRunning || job.lease_owner != gone) {
      return absl::AbortedError(absl::StrCat("jobs/", id, " is no longer held by ", gone));
    }
    job.lease_owner = holder_.name;
    job.lease_end = FromMicros(LeaseEnd(sql, holder_));
    UpdateJob(sql, job);
    return job;
  });
}

absl::Status JobQueue::SetJobLaunch(const std::string& id, int64_t fence,
                                    const std::string& launch) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(JobRecord job, SelectAttempt(sql, id, fence, holder_));
    job.launch = launch;
    UpdateJob(sql, job);
    return absl::OkStatus();
  });
}

absl::StatusOr<int64_t> JobQueue::TakeNextFence(const std::string& id, const std::string& launch) {
  return database_.Query<int64_t>([&](soci::session& sql) -> absl::StatusOr<int64_t> {
    ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, id));
    // Asked by the worker itself, which does not know the holder. The launcher's name identifies
    // it: a job that was claimed again has another launch.
    if (job.state != JobState::kRunning || job.launch != launch) {
      return absl::AbortedError(absl::StrCat("jobs/", id, " is no longer run by ", launch));
    }
    job.fence += 1;
    job.stage.clear();
    UpdateJob(sql, job);
    return job.fence;
  });
}

absl::Status JobQueue::SetJobStage(const std::string& id, int64_t fence, const std::string& stage) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(JobRecord job, SelectAttempt(sql, id, fence, holder_));
    job.stage = stage;
    UpdateJob(sql, job);
    return absl::OkStatus();
  });
}

absl::StatusOr<JobRecord> JobQueue::RequestCancel(const std::string& id) {
  return database_.Query<JobRecord>([&](soci::session& sql) -> absl::StatusOr<JobRecord> {
    ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, id));
    if (IsTerminal(job.state)) return job;
    job.cancel_requested = true;
    // A RUNNING job stays so until its holder has stopped the worker and writes the end (EndJob or
    // RequeueJob).
    if (job.state == JobState::kQueued) MarkCancelled(job);
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<JobRecord> JobQueue::RequeueJob(const std::string& id, int64_t fence,
                                               const EndedAttempt& attempt) {
  return database_.Query<JobRecord>([&](soci::session& sql) -> absl::StatusOr<JobRecord> {
    ASSIGN_OR_RETURN(JobRecord job, SelectAttempt(sql, id, fence, holder_));
    EndClaim(job);
    // A request that came while the attempt ended counts: the job must not start again.
    if (job.cancel_requested) {
      MarkCancelled(job);  // keeps the stage of the attempt
    } else {
      job.state = JobState::kQueued;
      job.stage.clear();
      job.start_time = absl::InfinitePast();
      CountAttempt(attempt, job);
      if (attempt.pause > absl::ZeroDuration()) {
        job.not_before = FromMicros(DatabaseMicros(sql) + absl::ToInt64Microseconds(attempt.pause));
      }
    }
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<JobRecord> JobQueue::EndJob(const std::string& id, int64_t fence,
                                           const absl::Status& error) {
  return database_.Query<JobRecord>([&](soci::session& sql) -> absl::StatusOr<JobRecord> {
    ASSIGN_OR_RETURN(JobRecord job, SelectAttempt(sql, id, fence, holder_));
    job.state = JobState::kFailed;
    job.error_code = static_cast<int>(error.code());
    job.error_message = std::string(error.message());
    job.end_time = absl::Now();
    EndClaim(job);
    if (absl::IsCancelled(error)) MarkCancelled(job);
    UpdateJob(sql, job);
    return job;
  });
}

absl::StatusOr<ModelRecord> JobQueue::CommitModel(const std::string& id, int64_t fence,
                                                  const ModelRecord& model) {
  return database_.Query<ModelRecord>([&](soci::session& sql) -> absl::StatusOr<ModelRecord> {
    ASSIGN_OR_RETURN(JobRecord job, SelectAttempt(sql, id, fence, holder_));
    ModelRecord row = model;
    row.scene = job.scene;
    row.job = job.id;
    row.dataset = job.dataset;
    row.device = job.device;
    // The model's record and the end of its job are one transaction: a kill leaves either a RUNNING
    // job without a model, which is tried again, or both.
    row.number = TakeNumber(sql, job.scene, "next_model");
    row.create_time = absl::Now();
    InsertModel(sql, row);
    job.state = JobState::kSucceeded;
    job.model = row.number;
    job.end_time = row.create_time;
    EndClaim(job);
    UpdateJob(sql, job);
    return row;
  });
}

}  // namespace pepeseg
