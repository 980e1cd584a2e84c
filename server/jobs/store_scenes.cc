#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/database.h"
#include "server/jobs/store.h"
#include "server/jobs/store_sql.h"

namespace pepeseg {
namespace {

std::vector<SceneRow> SelectScenes(soci::session& sql, const std::string& where,
                                   const std::string& key, int64_t limit) {
  SceneRow row;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, display_name, request_id, create_time FROM scenes WHERE " << where
                   << " :key ORDER BY id LIMIT :limit",
       soci::into(row.id), soci::into(row.display_name), soci::into(row.request_id),
       soci::into(create_time), soci::use(key), soci::use(limit));
  select.execute();
  std::vector<SceneRow> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

absl::StatusOr<SceneRow> InsertScene(soci::session& sql, const SceneRow& scene) {
  if (!scene.request_id.empty()) {
    const auto earlier = SelectScenes(sql, "request_id =", scene.request_id, 1);
    if (!earlier.empty() && earlier[0].id == scene.id &&
        earlier[0].display_name == scene.display_name) {
      return earlier[0];
    }
    if (!earlier.empty()) {
      return absl::AlreadyExistsError(absl::StrCat("request_id '", scene.request_id,
                                                   "' was used to create scenes/", earlier[0].id));
    }
  }
  if (!SelectScenes(sql, "id =", scene.id, 1).empty()) {
    return absl::AlreadyExistsError(absl::StrCat("scenes/", scene.id, " exists already"));
  }
  SceneRow row = scene;
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  sql << "INSERT INTO scenes (id, display_name, request_id, create_time, next_dataset, next_model)"
         " VALUES (:id, :name, :request, :time, 1, 1)",
      soci::use(row.id), soci::use(row.display_name), soci::use(row.request_id), soci::use(now);
  return row;
}

}  // namespace

absl::StatusOr<SceneRow> Store::CreateScene(const SceneRow& scene) {
  if (!IsRfc1034Label(scene.id)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "scene id '", scene.id, "': must be 1 to 63 of a-z, 0-9 and '-', from a letter to no '-'"));
  }
  return database_->Query<SceneRow>([&](soci::session& sql) { return InsertScene(sql, scene); });
}

absl::StatusOr<SceneRow> Store::GetScene(const std::string& id) {
  return database_->Query<SceneRow>([&](soci::session& sql) -> absl::StatusOr<SceneRow> {
    RETURN_IF_ERROR(CheckScene(sql, id));
    return SelectScenes(sql, "id =", std::string(id), 1).at(0);
  });
}

absl::StatusOr<Page<SceneRow>> Store::ListScenes(const PageRequest& page) {
  ASSIGN_OR_RETURN(const PageStart start, StartPage("scenes", page));
  return database_->Query<Page<SceneRow>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<SceneRow>> {
        Page<SceneRow> answer;
        answer.rows = SelectScenes(sql, "id >", start.key, start.limit + 1);
        if (static_cast<int64_t>(answer.rows.size()) > start.limit) {
          answer.rows.pop_back();
          answer.next_page_token = NextToken("scenes", answer.rows.back().id);
        }
        return answer;
      });
}

absl::Status Store::DeleteScene(const std::string& id) {
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    RETURN_IF_ERROR(CheckScene(sql, id));
    const JobRow active = SelectActiveJob(sql, id);
    if (!active.id.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("scenes/", id, " has an active job: cancel jobs/", active.id, " first"));
    }
    sql << "DELETE FROM scenes WHERE id = :id", soci::use(id);  // the rest cascades
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
