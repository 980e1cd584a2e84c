#include "server/store/job_store.h"

#include <limits>

#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/quota.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

constexpr int64_t kNewest = std::numeric_limits<int64_t>::max();

// Returns 12 for "j12", and 0 for a text that is not the id of a job.
int64_t JobNumber(const std::string& id) {
  int64_t number = 0;
  if (!id.starts_with('j') || !absl::SimpleAtoi(id.substr(1), &number)) return 0;
  return absl::StrCat("j", number) == id ? number : 0;
}

// Reads a column with a serialised message. It is base64, since SQL text cannot hold a zero byte.
std::string FromColumn(const std::string& text) {
  std::string bytes;
  absl::Base64Unescape(text, &bytes);
  return bytes;
}

// Returns the job that an earlier call with this request_id made; its id is empty if there was
// none. ALREADY_EXISTS: it has another dataset or other options.
absl::StatusOr<JobRecord> FindEarlier(soci::session& sql, const JobRecord& wanted) {
  if (wanted.request_id.empty()) return JobRecord();
  int64_t number = 0;
  sql << "SELECT number FROM jobs WHERE scene = :scene AND request_id = :request",
      soci::use(wanted.scene.id), soci::use(wanted.request_id), soci::into(number);
  if (!sql.got_data()) return JobRecord();
  ASSIGN_OR_RETURN(JobRecord earlier, SelectJob(sql, absl::StrCat("j", number)));
  // The options as the client sent them: effective ones would differ after a default has changed.
  if (earlier.dataset != wanted.dataset || earlier.options != wanted.options) {
    return absl::AlreadyExistsError(absl::StrCat("request_id '", wanted.request_id,
                                                 "' was used to create jobs/", earlier.id,
                                                 " with other settings"));
  }
  return earlier;
}

// Returns OK if the dataset is sealed and the scene has no active job.
absl::Status CheckStartable(soci::session& sql, const JobRecord& job) {
  ASSIGN_OR_RETURN(const DatasetRecord dataset, SelectDataset(sql, job.scene, job.dataset));
  if (dataset.state != DatasetState::kSealed) {
    return absl::FailedPreconditionError(
        absl::StrCat(ChildName(job.scene, "datasets", job.dataset), " is not sealed"));
  }
  const JobRecord active = SelectActiveJob(sql, job.scene);
  if (active.id.empty()) return absl::OkStatus();
  // The index active_jobs enforces the same against a job that another server inserts at this
  // moment.
  return absl::AbortedError(
      absl::StrCat(SceneName(job.scene), " is already being trained by jobs/", active.id));
}

absl::StatusOr<JobRecord> InsertJob(soci::session& sql, const JobRecord& job) {
  int64_t number = 0;
  // The counter is not MAX(number) + 1: numbers name folders, and must not come back after a
  // deletion.
  sql << "UPDATE job_numbers SET next_job = next_job + 1";
  sql << "SELECT next_job - 1 FROM job_numbers", soci::into(number);
  // See FromColumn.
  const std::string options = absl::Base64Escape(job.options);
  const std::string effective = absl::Base64Escape(job.effective_options);
  const int64_t now = absl::ToUnixMicros(absl::Now());
  const int preview = job.preview ? 1 : 0;
  sql << "INSERT INTO jobs (number, scene, dataset, state, stage, options, effective_options,"
         " request_id, preview, fence, host_bytes, seconds, cancel_requested, error_code, "
         "error_message,"
         " model, create_time, start_time, end_time, traceparent) VALUES (:number, :scene, "
         ":dataset,"
         " 0, '', :options, :effective, :request, :preview, 0, :bytes, :seconds, 0, 0, '', 0, "
         ":now, 0, 0,"
         " :traceparent)",
      soci::use(number), soci::use(job.scene.id), soci::use(job.dataset), soci::use(options),
      soci::use(effective), soci::use(job.request_id), soci::use(preview),
      soci::use(job.host_bytes), soci::use(job.seconds), soci::use(now), soci::use(job.traceparent);
  return SelectJob(sql, absl::StrCat("j", number));
}

// Returns the part of WHERE that a filter decides. It is part of the text because the number of
// placeholders would vary.
absl::StatusOr<std::string> WhereOf(const JobStore::JobFilter& filter) {
  std::string where;
  if (filter.scene) absl::StrAppend(&where, "scene = ", filter.scene->id, " AND ");
  if (filter.state) absl::StrAppend(&where, "state = ", static_cast<int>(*filter.state), " AND ");
  if (filter.project.empty()) return where;
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(filter.project));
  return where + of_project;
}

}  // namespace

std::vector<JobRecord> SelectJobs(soci::session& sql, const std::string& where_order, int64_t key,
                                  int64_t limit) {
  JobRecord row;
  int state = 0;
  int cancel_requested = 0;
  int preview = 0;
  int64_t lease_end = 0;
  int64_t not_before = 0;
  int64_t create_time = 0;
  int64_t start_time = 0;
  int64_t end_time = 0;
  std::string options;
  std::string effective;
  soci::statement select =
      (sql.prepare
           << "SELECT number, scene, scenes.project, scenes.name, dataset, state, stage, device,"
              " options, effective_options, jobs.request_id, preview, fence, lease_owner, "
              "lease_end, launch,"
              " crashes, server_ends, put_backs, not_before, host_bytes, seconds, cancel_requested,"
              " error_code, error_message, model, jobs.create_time, start_time, end_time,"
              " traceparent FROM jobs JOIN scenes ON scenes.id = jobs.scene WHERE "
           << where_order << " LIMIT :limit",
       soci::into(row.number), soci::into(row.scene.id), soci::into(row.scene.project),
       soci::into(row.scene.name), soci::into(row.dataset), soci::into(state),
       soci::into(row.stage), soci::into(row.device), soci::into(options), soci::into(effective),
       soci::into(row.request_id), soci::into(preview), soci::into(row.fence),
       soci::into(row.lease_owner), soci::into(lease_end), soci::into(row.launch),
       soci::into(row.crashes), soci::into(row.server_ends), soci::into(row.put_backs),
       soci::into(not_before), soci::into(row.host_bytes), soci::into(row.seconds),
       soci::into(cancel_requested), soci::into(row.error_code), soci::into(row.error_message),
       soci::into(row.model), soci::into(create_time), soci::into(start_time), soci::into(end_time),
       soci::into(row.traceparent), soci::use(key), soci::use(limit));
  select.execute();
  std::vector<JobRecord> rows;
  while (select.fetch()) {
    row.id = absl::StrCat("j", row.number);
    row.state = static_cast<JobState>(state);
    row.cancel_requested = cancel_requested != 0;
    row.preview = preview != 0;
    row.options = FromColumn(options);
    row.effective_options = FromColumn(effective);
    row.lease_end = FromMicros(lease_end);
    row.not_before = FromMicros(not_before);
    row.create_time = FromMicros(create_time);
    row.start_time = FromMicros(start_time);
    row.end_time = FromMicros(end_time);
    rows.push_back(row);
  }
  return rows;
}

absl::StatusOr<JobRecord> SelectJob(soci::session& sql, const std::string& id) {
  std::vector<JobRecord> rows = SelectJobs(sql, "number = :number", JobNumber(id), 1);
  if (rows.empty()) return absl::NotFoundError(absl::StrCat("jobs/", id, " does not exist"));
  return rows[0];
}

JobRecord SelectActiveJob(soci::session& sql, const SceneRef& scene) {
  int64_t number = 0;
  // At most one, by the index active_jobs. 0 is QUEUED, 1 is RUNNING.
  sql << "SELECT number FROM jobs WHERE scene = :scene AND state IN (0, 1)", soci::use(scene.id),
      soci::into(number);
  if (!sql.got_data()) return JobRecord();
  return SelectJobs(sql, "number = :number", number, 1).at(0);
}

absl::StatusOr<JobRecord> JobStore::CreateJob(const JobRecord& job) {
  return database_.Query<JobRecord>([&](soci::session& sql) -> absl::StatusOr<JobRecord> {
    RETURN_IF_ERROR(CheckScene(sql, job.scene));
    // First, so that a retry gets its job even if the scene has an active job by now, which is that
    // job.
    ASSIGN_OR_RETURN(JobRecord earlier, FindEarlier(sql, job));
    if (!earlier.id.empty()) return earlier;
    RETURN_IF_ERROR(CheckStartable(sql, job));
    ASSIGN_OR_RETURN(JobRecord made, InsertJob(sql, job));
    // Checked after the insertion, so that the job counts. An error rolls it back.
    RETURN_IF_ERROR(CheckQueueQuota(sql, job.scene.project, defaults_));
    return made;
  });
}

absl::StatusOr<JobRecord> JobStore::GetJob(const std::string& id) {
  return database_.Query<JobRecord>([&](soci::session& sql) { return SelectJob(sql, id); });
}

absl::StatusOr<Page<JobRecord>> JobStore::ListJobs(const JobFilter& filter,
                                                   const PageRequest& page) {
  const std::string list =
      // The token is bound to the filter: a page of another list would skip or repeat jobs.
      absl::StrCat("jobs/", filter.scene ? filter.scene->id : 0, "/",
                   filter.state ? static_cast<int>(*filter.state) : -1, "/", filter.project);
  ASSIGN_OR_RETURN(const std::string where, WhereOf(filter));
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  ASSIGN_OR_RETURN(const int64_t key, NumberKey(start, kNewest));
  return database_.Query<Page<JobRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<JobRecord>> {
        if (filter.scene) RETURN_IF_ERROR(CheckScene(sql, *filter.scene));
        Page<JobRecord> answer;
        answer.records =
            SelectJobs(sql, where + "number < :key ORDER BY number DESC", key, start.limit + 1);
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, absl::StrCat(answer.records.back().number));
        }
        return answer;
      });
}

absl::StatusOr<std::optional<JobRecord>> JobStore::FindActiveJob(const SceneRef& scene) {
  using Found = std::optional<JobRecord>;
  return database_.Query<Found>([&](soci::session& sql) -> absl::StatusOr<Found> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    JobRecord active = SelectActiveJob(sql, scene);
    return active.id.empty() ? Found() : Found(std::move(active));
  });
}

absl::StatusOr<int64_t> JobStore::NextJobNumber() {
  return database_.Query<int64_t>([](soci::session& sql) -> absl::StatusOr<int64_t> {
    int64_t next = 0;
    sql << "SELECT next_job FROM job_numbers", soci::into(next);
    return next;
  });
}

absl::StatusOr<std::string> JobStore::ProjectOfJob(const std::string& id) {
  const int64_t number = JobNumber(id);
  if (number <= 0)
    return absl::InvalidArgumentError(absl::StrCat("'", id, "' is not the id of a job"));
  return database_.Read<std::string>([&](soci::session& sql) -> absl::StatusOr<std::string> {
    std::string project;
    sql << "SELECT scenes.project FROM jobs JOIN scenes ON scenes.id = jobs.scene"
           " WHERE jobs.number = :number",
        soci::use(number), soci::into(project);
    if (!sql.got_data()) return absl::NotFoundError(absl::StrCat("jobs/", id, " does not exist"));
    return project;
  });
}

}  // namespace pepeseg
