#include "server/jobs/quota_sql.h"

#include "core/status_macros.h"
#include "server/jobs/quota_error.h"

namespace pepeseg {
namespace {

std::string SelectProjectOf(soci::session& sql, const std::string& scene) {
  std::string project;
  sql << "SELECT project FROM scenes WHERE id = :id", soci::use(scene), soci::into(project);
  return project;
}

// The project's own where it has any.
Quota SelectInForce(soci::session& sql, const std::string& project, const Quota& defaults) {
  Quota own;
  sql << "SELECT stored_bytes, open_uploads, queued_jobs, running_jobs FROM projects"
         " WHERE id = :id",
      soci::use(project), soci::into(own.stored_bytes), soci::into(own.open_uploads),
      soci::into(own.queued_jobs), soci::into(own.running_jobs);
  return InForce(own, defaults);
}

// Each digest once, and those of open uploads as if they were there: what was accepted can be
// finished.
int64_t SumStoredBytes(soci::session& sql, const std::string& project) {
  int64_t bytes = 0;
  sql << "SELECT CAST(COALESCE(SUM(size), 0) AS BIGINT) FROM (SELECT MAX(f.size) AS size"
         " FROM dataset_files f JOIN scenes s ON s.id = f.scene WHERE s.project = :project"
         " GROUP BY f.sha256) AS files",
      soci::use(project), soci::into(bytes);
  return bytes;
}

int64_t CountOpenUploads(soci::session& sql, const std::string& project) {
  int64_t count = 0;
  sql << "SELECT COUNT(*) FROM datasets d JOIN scenes s ON s.id = d.scene"
         " WHERE s.project = :project AND d.state = 0",
      soci::use(project), soci::into(count);
  return count;
}

int64_t CountJobs(soci::session& sql, const std::string& project, int state) {
  int64_t count = 0;
  sql << "SELECT COUNT(*) FROM jobs j JOIN scenes s ON s.id = j.scene"
         " WHERE s.project = :project AND j.state = :state",
      soci::use(project), soci::use(state), soci::into(count);
  return count;
}

absl::Status CheckOne(const char* name, int64_t need, int64_t limit) {
  return need <= limit ? absl::OkStatus() : QuotaError(name, need, limit);
}

constexpr int kQueued = 0, kRunning = 1;  // JobState

}  // namespace

Quota SelectUsage(soci::session& sql, const std::string& project) {
  Quota used;
  used.stored_bytes = SumStoredBytes(sql, project);
  used.open_uploads = CountOpenUploads(sql, project);
  used.queued_jobs = CountJobs(sql, project, kQueued);
  used.running_jobs = CountJobs(sql, project, kRunning);
  return used;
}

absl::Status CheckUploadQuotas(soci::session& sql, const std::string& scene,
                               const Quota& defaults) {
  const std::string project = SelectProjectOf(sql, scene);
  const Quota quota = SelectInForce(sql, project, defaults);
  if (quota.open_uploads > 0) {
    RETURN_IF_ERROR(CheckOne("open_uploads", CountOpenUploads(sql, project), quota.open_uploads));
  }
  if (quota.stored_bytes == 0) return absl::OkStatus();
  return CheckOne("stored_bytes", SumStoredBytes(sql, project), quota.stored_bytes);
}

absl::Status CheckQueueQuota(soci::session& sql, const std::string& scene, const Quota& defaults) {
  const std::string project = SelectProjectOf(sql, scene);
  const Quota quota = SelectInForce(sql, project, defaults);
  if (quota.queued_jobs == 0) return absl::OkStatus();
  return CheckOne("queued_jobs", CountJobs(sql, project, kQueued), quota.queued_jobs);
}

}  // namespace pepeseg
