#include "server/store/quota_store.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/quota_sql.h"
#include "server/store/scene_key.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

// Returns a project; its create_time is InfinitePast if there is no record of it.
ProjectRow SelectProject(soci::session& sql, const std::string& id) {
  ProjectRow row;
  row.id = id;
  int64_t create_time = 0;
  Quota& quota = row.quota;
  sql << "SELECT stored_bytes, open_uploads, queued_jobs, running_jobs, queries_per_second,"
         " resident_bytes, create_time FROM projects WHERE id = :id",
      soci::use(id), soci::into(quota.stored_bytes), soci::into(quota.open_uploads),
      soci::into(quota.queued_jobs), soci::into(quota.running_jobs),
      soci::into(quota.queries_per_second), soci::into(quota.resident_bytes),
      soci::into(create_time);
  row.create_time = FromMicros(create_time);
  return row;
}

}  // namespace

absl::Status EnsureProject(soci::session& sql, const std::string& id) {
  if (!IsRfc1034Label(id)) {
    return absl::InvalidArgumentError(
        absl::StrCat("project '", id,
                     "': must be 1 to 63 of a-z, 0-9 and '-', beginning with a letter and not "
                     "ending with '-'"));
  }
  if (SelectProject(sql, id).create_time != absl::InfinitePast()) return absl::OkStatus();
  const int64_t now = absl::ToUnixMicros(absl::Now());
  sql << "INSERT INTO projects (id, stored_bytes, open_uploads, queued_jobs, running_jobs,"
         " queries_per_second, resident_bytes, create_time) VALUES (:id, 0, 0, 0, 0, 0, 0, :time)",
      soci::use(id), soci::use(now);
  return absl::OkStatus();
}

absl::StatusOr<ProjectRow> QuotaStore::GetProject(const std::string& id) {
  return database_.Read<ProjectRow>(
      [&](soci::session& sql) -> absl::StatusOr<ProjectRow> { return SelectProject(sql, id); });
}

absl::StatusOr<ProjectRow> QuotaStore::SetProjectQuota(const std::string& id, const Quota& quota) {
  return database_.Query<ProjectRow>([&](soci::session& sql) -> absl::StatusOr<ProjectRow> {
    RETURN_IF_ERROR(EnsureProject(sql, id));
    sql << "UPDATE projects SET stored_bytes = :stored, open_uploads = :uploads, queued_jobs ="
           " :queued, running_jobs = :running, queries_per_second = :queries, resident_bytes ="
           " :resident WHERE id = :id",
        soci::use(quota.stored_bytes), soci::use(quota.open_uploads), soci::use(quota.queued_jobs),
        soci::use(quota.running_jobs), soci::use(quota.queries_per_second),
        soci::use(quota.resident_bytes), soci::use(id);
    return SelectProject(sql, id);
  });
}

absl::StatusOr<Quota> QuotaStore::GetUsage(const std::string& project) {
  return database_.Query<Quota>(
      [&](soci::session& sql) -> absl::StatusOr<Quota> { return SelectUsage(sql, project); });
}

}  // namespace pepeseg
