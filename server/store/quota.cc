#include "server/store/quota.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/error_detail.h"
#include "server/store/soci.h"

namespace pepeseg {
namespace {

// Returns the limits of a project: its own values where they are set, else the defaults.
Quota SelectInForce(soci::session& sql, const std::string& project, const Quota& defaults) {
  // Stays 0, which means the server's default, if the project has no record.
  Quota own;
  sql << "SELECT stored_bytes, open_uploads, queued_jobs, running_jobs FROM projects"
         " WHERE id = :id",
      soci::use(project), soci::into(own.stored_bytes), soci::into(own.open_uploads),
      soci::into(own.queued_jobs), soci::into(own.running_jobs);
  return InForce(own, defaults);
}

// Returns the sum of a column of bytes. `column_from_where`: the query after "SUM(", with one
// placeholder for the project.
int64_t SumBytes(soci::session& sql, const std::string& column_from_where,
                 const std::string& project) {
  int64_t bytes = 0;
  sql << "SELECT CAST(COALESCE(SUM(" << column_from_where, soci::use(project), soci::into(bytes);
  return bytes;
}

// Returns the bytes that a project has on the disk, and those that its open uploads may add.
//
// A file of an open upload counts with its declared size until the project has its bytes. Uploads
// of one digest count separately: each has its own partial file, whose bytes are not checked until
// it is complete, so a digest may be made up. For the same reason files with one digest but
// different declared sizes count separately. Stored blobs count once per digest.
int64_t SumStoredBytes(soci::session& sql, const std::string& project) {
  // PostgreSQL's SUM of BIGINT is NUMERIC, hence the CAST; COALESCE is for a project without
  // records.
  return SumBytes(sql, "size), 0) AS BIGINT) FROM blobs WHERE project = :project", project) +
         SumBytes(sql,
                  "size), 0) AS BIGINT) FROM (SELECT f.size AS size FROM dataset_files f"
                  " JOIN datasets d ON d.scene = f.scene AND d.number = f.dataset"
                  " JOIN scenes s ON s.id = d.scene WHERE s.project = :project AND d.state = 0"
                  " GROUP BY f.scene, f.dataset, f.sha256, f.size HAVING MAX(f.stored) = 0)"
                  " AS missing",
                  project) +
         SumBytes(sql,
                  "m.num_bytes), 0) AS BIGINT) FROM models m JOIN scenes s ON s.id = m.scene"
                  " WHERE s.project = :project",
                  project) +
         SumBytes(sql,
                  "l.num_bytes), 0) AS BIGINT) FROM selections l JOIN scenes s ON s.id = l.scene"
                  " WHERE s.project = :project",
                  project);
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

Quota InForce(const Quota& own, const Quota& server) {
  const auto pick = [](int64_t of_project, int64_t of_server) {
    return of_project > 0 ? of_project : of_server;
  };
  return {pick(own.stored_bytes, server.stored_bytes),
          pick(own.open_uploads, server.open_uploads),
          pick(own.queued_jobs, server.queued_jobs),
          pick(own.running_jobs, server.running_jobs),
          pick(own.queries_per_second, server.queries_per_second),
          pick(own.resident_bytes, server.resident_bytes)};
}

absl::Status QuotaError(const std::string& name, int64_t need, int64_t limit) {
  // Not private, unlike the database's RESOURCE_EXHAUSTED for a full disk: callers tell the two
  // apart by that.
  return WithDetail(
      absl::ResourceExhaustedError(absl::StrCat(
          "the project's quota of ", name, " is ", limit, ", this would make it ", need,
          "; delete what is not needed, or ask the server's operator for a higher "
          "quota")),
      {.reason = "QUOTA",
       .field = name,
       .limit = absl::StrCat(limit),
       .value = absl::StrCat(need)});
}

Quota SelectUsage(soci::session& sql, const std::string& project) {
  Quota used;
  used.stored_bytes = SumStoredBytes(sql, project);
  used.open_uploads = CountOpenUploads(sql, project);
  used.queued_jobs = CountJobs(sql, project, kQueued);
  used.running_jobs = CountJobs(sql, project, kRunning);
  return used;
}

absl::Status CheckUploadQuotas(soci::session& sql, const std::string& project,
                               const Quota& defaults) {
  const Quota quota = SelectInForce(sql, project, defaults);
  if (quota.open_uploads > 0) {
    RETURN_IF_ERROR(CheckOne("open_uploads", CountOpenUploads(sql, project), quota.open_uploads));
  }
  if (quota.stored_bytes == 0) return absl::OkStatus();
  return CheckOne("stored_bytes", SumStoredBytes(sql, project), quota.stored_bytes);
}

absl::Status CheckQueueQuota(soci::session& sql, const std::string& project,
                             const Quota& defaults) {
  const Quota quota = SelectInForce(sql, project, defaults);
  if (quota.stored_bytes > 0) {
    // The size of the model is not known yet: reserve one byte.
    RETURN_IF_ERROR(CheckOne("stored_bytes", SumStoredBytes(sql, project) + 1, quota.stored_bytes));
  }
  if (quota.queued_jobs == 0) return absl::OkStatus();
  return CheckOne("queued_jobs", CountJobs(sql, project, kQueued), quota.queued_jobs);
}

absl::Status CheckStoredBytes(soci::session& sql, const std::string& project,
                              const Quota& defaults) {
  const Quota quota = SelectInForce(sql, project, defaults);
  if (quota.stored_bytes == 0) return absl::OkStatus();
  return CheckOne("stored_bytes", SumStoredBytes(sql, project), quota.stored_bytes);
}

}  // namespace pepeseg
