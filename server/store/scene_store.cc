#include "server/store/scene_store.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/scene_key.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

// Which scenes to select: those for which `where`, followed by `key`, holds.
struct SceneQuery {
  std::string where;
  std::string key;
  int64_t limit = 1;
  std::string order = "name";
};

std::vector<SceneRow> SelectScenes(soci::session& sql, const SceneQuery& query) {
  SceneRow row;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, name, display_name, request_id, create_time, project FROM scenes"
                      " WHERE "
                   << query.where << " :key ORDER BY " << query.order << " LIMIT :limit",
       soci::into(row.key), soci::into(row.id), soci::into(row.display_name),
       soci::into(row.request_id), soci::into(create_time), soci::into(row.project),
       soci::use(query.key), soci::use(query.limit));
  select.execute();
  std::vector<SceneRow> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

// Returns a key for a new scene: its id, or "NUMBER@ID" if another scene has that key.
std::string TakeSceneKey(soci::session& sql, const SceneRow& scene) {
  // A scene of another project may have the plain id as its key.
  if (SelectScenes(sql, {"id =", scene.id}).empty()) return scene.id;
  int64_t next = 0;
  // The update first, so that it locks the record: two servers that both read the number first
  // would take the same one.
  sql << "UPDATE scene_numbers SET next_scene = next_scene + 1";
  sql << "SELECT next_scene FROM scene_numbers", soci::into(next);
  return MakeSceneKey(next - 1, scene.id);
}

absl::StatusOr<SceneRow> InsertScene(soci::session& sql, const SceneRow& scene) {
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(scene.project));
  if (!scene.request_id.empty()) {
    // A repeated request is found before the check for an existing scene, which is the one that it
    // made.
    const auto earlier = SelectScenes(sql, {of_project + "request_id =", scene.request_id});
    if (!earlier.empty() && earlier[0].id == scene.id &&
        earlier[0].display_name == scene.display_name) {
      return earlier[0];
    }
    if (!earlier.empty()) {
      return absl::AlreadyExistsError(absl::StrCat("request_id '", scene.request_id,
                                                   "' was used to create scenes/", earlier[0].id));
    }
  }
  if (!SelectScenes(sql, {of_project + "name =", scene.id}).empty()) {
    return absl::AlreadyExistsError(absl::StrCat("scenes/", scene.id, " exists already"));
  }
  SceneRow row = scene;
  row.key = TakeSceneKey(sql, scene);
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  sql << "INSERT INTO scenes (id, name, display_name, request_id, create_time, project,"
         " next_dataset, next_model) VALUES (:id, :name, :display, :request, :time, :project, 1, "
         "1)",
      soci::use(row.key), soci::use(row.id), soci::use(row.display_name), soci::use(row.request_id),
      soci::use(now), soci::use(row.project);
  return row;
}

absl::Status NoScene(const std::string& id) {
  return absl::NotFoundError(absl::StrCat("scenes/", id, " does not exist"));
}

absl::Status CheckSceneId(const std::string& id) {
  if (IsResourceId(id)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("scene id '", id, "': ", kResourceIdRule));
}

}  // namespace

absl::StatusOr<SceneRow> SceneStore::CreateScene(const SceneRow& scene) {
  RETURN_IF_ERROR(CheckSceneId(scene.id));
  if (!IsRfc1034Label(scene.project)) {
    return absl::InvalidArgumentError(
        absl::StrCat("project '", scene.project, "' is not an RFC 1034 label"));
  }
  return database_.Query<SceneRow>([&](soci::session& sql) { return InsertScene(sql, scene); });
}

absl::StatusOr<std::string> SceneStore::FindScene(const std::string& project,
                                                  const std::string& id) {
  RETURN_IF_ERROR(CheckSceneId(id));
  return database_.Read<std::string>([&](soci::session& sql) -> absl::StatusOr<std::string> {
    std::string key;
    sql << "SELECT id FROM scenes WHERE project = :project AND name = :name", soci::use(project),
        soci::use(id), soci::into(key);
    if (!sql.got_data()) return NoScene(id);
    return key;
  });
}

absl::StatusOr<std::vector<SceneRow>> SceneStore::FindScenes(const std::string& id) {
  // Enough for a message that lists the projects to choose from.
  constexpr int64_t kMost = 10;
  RETURN_IF_ERROR(CheckSceneId(id));
  return database_.Read<std::vector<SceneRow>>([&](soci::session& sql) {
    return SelectScenes(sql, {"name =", id, kMost, "project"});
  });
}

absl::StatusOr<SceneRow> SceneStore::GetScene(const std::string& key) {
  return database_.Query<SceneRow>([&](soci::session& sql) -> absl::StatusOr<SceneRow> {
    RETURN_IF_ERROR(CheckScene(sql, key));
    return SelectScenes(sql, {"id =", key}).at(0);
  });
}

absl::StatusOr<Page<SceneRow>> SceneStore::ListScenes(const PageRequest& page,
                                                      const std::string& project) {
  const std::string list = absl::StrCat("scenes/", project);
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(project));
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  return database_.Query<Page<SceneRow>>([&](soci::session& sql) -> absl::StatusOr<Page<SceneRow>> {
    Page<SceneRow> answer;
    // Scenes of several projects may have the same id. Order by id and key then, so that a page
    // token identifies one scene.
    const bool of_all = project.empty();
    const std::string order = of_all ? "name || ' ' || id" : "name";
    answer.rows = SelectScenes(sql, {of_project + order + " >", start.key, start.limit + 1, order});
    if (static_cast<int64_t>(answer.rows.size()) > start.limit) {
      answer.rows.pop_back();
      const SceneRow& last = answer.rows.back();
      const std::string key = of_all ? absl::StrCat(last.id, " ", last.key) : last.id;
      answer.next_page_token = NextToken(list, key);
    }
    return answer;
  });
}

absl::Status SceneStore::DeleteScene(const std::string& key) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    RETURN_IF_ERROR(CheckScene(sql, key));
    // A worker would continue to write into the folder of a job that has no record.
    const JobRow active = SelectActiveJob(sql, key);
    if (!active.id.empty()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "scenes/", SceneIdOf(key), " has an active job: cancel jobs/", active.id, " first"));
    }
    sql << "DELETE FROM scenes WHERE id = :id",
        soci::use(key);  // records that refer to it are deleted by cascade
    return absl::OkStatus();
  });
}

absl::StatusOr<std::string> SceneStore::ProjectOfScene(const std::string& key) {
  RETURN_IF_ERROR(CheckSceneId(SceneIdOf(key)));
  return database_.Read<std::string>([&](soci::session& sql) -> absl::StatusOr<std::string> {
    std::string project;
    sql << "SELECT project FROM scenes WHERE id = :id", soci::use(key), soci::into(project);
    if (!sql.got_data()) return NoScene(SceneIdOf(key));
    return project;
  });
}

}  // namespace pepeseg
