#include "server/store/project_store.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/quota.h"
#include "server/store/resource_id.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

// Returns a project; its create_time is InfinitePast if there is no record of it.
ProjectRecord SelectProject(soci::session& sql, const std::string& id) {
  ProjectRecord row;
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

// Creates the project's record if there is none. INVALID_ARGUMENT: the id is not an RFC 1034 label.
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

// Returns up to `limit` keys for which `where`, followed by `key`, holds, ordered by id.
std::vector<KeyRecord> SelectKeys(soci::session& sql, const std::string& where,
                                  const std::string& key, int64_t limit) {
  KeyRecord row;
  int64_t create_time = 0;
  int64_t expire_time = 0;
  int64_t revoke_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, project, display_name, sha256, scopes, create_time, expire_time,"
                      " revoke_time FROM api_keys WHERE "
                   << where << " :key ORDER BY id LIMIT :limit",
       soci::into(row.id), soci::into(row.project), soci::into(row.display_name),
       soci::into(row.sha256), soci::into(row.scopes), soci::into(create_time),
       soci::into(expire_time), soci::into(revoke_time), soci::use(key), soci::use(limit));
  select.execute();
  std::vector<KeyRecord> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    row.expire_time = FromMicros(expire_time);
    row.revoke_time = FromMicros(revoke_time);
    rows.push_back(row);
  }
  return rows;
}

absl::StatusOr<KeyRecord> SelectKey(soci::session& sql, const std::string& id) {
  std::vector<KeyRecord> rows = SelectKeys(sql, "id =", id, 1);
  if (rows.empty()) return absl::NotFoundError(absl::StrCat("keys/", id, " does not exist"));
  return rows[0];
}

absl::Status InsertKey(soci::session& sql, const KeyRecord& key, int64_t now) {
  const int64_t expire_time = ToMicros(key.expire_time);
  sql << "INSERT INTO api_keys (id, project, display_name, sha256, scopes, create_time,"
         " expire_time, revoke_time) VALUES (:id, :project, :name, :sha256, :scopes, :now, :expire,"
         " 0)",
      soci::use(key.id), soci::use(key.project), soci::use(key.display_name), soci::use(key.sha256),
      soci::use(key.scopes), soci::use(now), soci::use(expire_time);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ProjectRecord> QuotaStore::GetProject(const std::string& id) {
  return database_.Read<ProjectRecord>(
      [&](soci::session& sql) -> absl::StatusOr<ProjectRecord> { return SelectProject(sql, id); });
}

absl::StatusOr<ProjectRecord> QuotaStore::SetProjectQuota(const std::string& id,
                                                          const Quota& quota) {
  return database_.Query<ProjectRecord>([&](soci::session& sql) -> absl::StatusOr<ProjectRecord> {
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

absl::StatusOr<KeyRecord> KeyStore::CreateKey(const KeyRecord& key) {
  return database_.Query<KeyRecord>([&](soci::session& sql) -> absl::StatusOr<KeyRecord> {
    // A project exists from its first key or quota on.
    RETURN_IF_ERROR(EnsureProject(sql, key.project));
    const int64_t now = absl::ToUnixMicros(absl::Now());
    RETURN_IF_ERROR(InsertKey(sql, key, now));
    return SelectKeys(sql, "id =", key.id, 1).at(0);
  });
}

absl::StatusOr<KeyRecord> KeyStore::GetKey(const std::string& id) {
  return database_.Query<KeyRecord>([&](soci::session& sql) { return SelectKey(sql, id); });
}

absl::StatusOr<KeyRecord> KeyStore::FindKeyByDigest(const std::string& sha256) {
  return database_.Read<KeyRecord>([&](soci::session& sql) -> absl::StatusOr<KeyRecord> {
    std::vector<KeyRecord> rows = SelectKeys(sql, "sha256 =", sha256, 1);
    if (rows.empty()) return absl::NotFoundError("no key has this secret");
    return rows[0];
  });
}

absl::StatusOr<Page<KeyRecord>> KeyStore::ListKeys(const std::string& project,
                                                   const PageRequest& page) {
  const std::string list = absl::StrCat("keys/", project);
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(project));
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  return database_.Query<Page<KeyRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<KeyRecord>> {
        Page<KeyRecord> answer;
        answer.records = SelectKeys(sql, of_project + "id >", start.key, start.limit + 1);
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, answer.records.back().id);
        }
        return answer;
      });
}

absl::StatusOr<KeyRecord> KeyStore::RevokeKey(const std::string& id) {
  return database_.Query<KeyRecord>([&](soci::session& sql) -> absl::StatusOr<KeyRecord> {
    const int64_t now = absl::ToUnixMicros(absl::Now());
    // Revoking twice keeps the first time.
    sql << "UPDATE api_keys SET revoke_time = :now WHERE id = :id AND revoke_time = 0",
        soci::use(now), soci::use(id);
    return SelectKey(sql, id);
  });
}

}  // namespace pepeseg
