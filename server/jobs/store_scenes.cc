#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/database.h"
#include "server/jobs/id_rules.h"
#include "server/jobs/store.h"
#include "server/jobs/store_sql.h"

namespace pepeseg {
namespace {

std::vector<SceneRow> SelectScenes(soci::session& sql, const std::string& where,
                                   const std::string& key, int64_t limit) {
  SceneRow row;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, display_name, request_id, create_time, project FROM scenes WHERE "
                   << where << " :key ORDER BY id LIMIT :limit",
       soci::into(row.id), soci::into(row.display_name), soci::into(row.request_id),
       soci::into(create_time), soci::into(row.project), soci::use(key), soci::use(limit));
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
    ASSIGN_OR_RETURN(const std::string of_project, OfProject(scene.project));
    const auto earlier = SelectScenes(sql, of_project + "request_id =", scene.request_id, 1);
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
  sql << "INSERT INTO scenes (id, display_name, request_id, create_time, project, next_dataset,"
         " next_model) VALUES (:id, :name, :request, :time, :project, 1, 1)",
      soci::use(row.id), soci::use(row.display_name), soci::use(row.request_id), soci::use(now),
      soci::use(row.project);
  return row;
}

}  // namespace

absl::StatusOr<SceneRow> Store::CreateScene(const SceneRow& scene) {
  if (!IsResourceId(scene.id)) {
    return absl::InvalidArgumentError(absl::StrCat("scene id '", scene.id, "': ", kResourceIdRule));
  }
  if (!IsRfc1034Label(scene.project)) {
    return absl::InvalidArgumentError(absl::StrCat("project '", scene.project, "' is no label"));
  }
  return database_->Query<SceneRow>([&](soci::session& sql) { return InsertScene(sql, scene); });
}

absl::StatusOr<SceneRow> Store::GetScene(const std::string& id) {
  return database_->Query<SceneRow>([&](soci::session& sql) -> absl::StatusOr<SceneRow> {
    RETURN_IF_ERROR(CheckScene(sql, id));
    return SelectScenes(sql, "id =", std::string(id), 1).at(0);
  });
}

absl::StatusOr<Page<SceneRow>> Store::ListScenes(const PageRequest& page,
                                                 const std::string& project) {
  const std::string list = absl::StrCat("scenes/", project);
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(project));
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  return database_->Query<Page<SceneRow>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<SceneRow>> {
        Page<SceneRow> answer;
        answer.rows = SelectScenes(sql, of_project + "id >", start.key, start.limit + 1);
        if (static_cast<int64_t>(answer.rows.size()) > start.limit) {
          answer.rows.pop_back();
          answer.next_page_token = NextToken(list, answer.rows.back().id);
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

absl::StatusOr<std::string> Store::ProjectOfScene(const std::string& id) {
  if (!IsResourceId(id)) {
    return absl::InvalidArgumentError(absl::StrCat("scene id '", id, "': ", kResourceIdRule));
  }
  return database_->Read<std::string>([&](soci::session& sql) -> absl::StatusOr<std::string> {
    std::string project;
    sql << "SELECT project FROM scenes WHERE id = :id", soci::use(id), soci::into(project);
    if (!sql.got_data()) return absl::NotFoundError(absl::StrCat("scenes/", id, " does not exist"));
    return project;
  });
}

}  // namespace pepeseg
