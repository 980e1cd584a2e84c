#include "server/store/scene_store.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/resource_id.h"
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

std::vector<SceneRecord> SelectScenes(soci::session& sql, const SceneQuery& query) {
  SceneRecord row;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, project, name, display_name, request_id, create_time FROM scenes"
                      " WHERE "
                   << query.where << " :key ORDER BY " << query.order << " LIMIT :limit",
       soci::into(row.scene.id), soci::into(row.scene.project), soci::into(row.scene.name),
       soci::into(row.display_name), soci::into(row.request_id), soci::into(create_time),
       soci::use(query.key), soci::use(query.limit));
  select.execute();
  std::vector<SceneRecord> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

// The counter is not MAX(id) + 1: ids name folders, and must not come back after a deletion.
int64_t TakeSceneId(soci::session& sql) {
  int64_t next = 0;
  // The update first, so that it locks the record: two servers that both read the number first
  // would take the same one.
  sql << "UPDATE scene_numbers SET next_scene = next_scene + 1";
  sql << "SELECT next_scene FROM scene_numbers", soci::into(next);
  return next - 1;
}

absl::StatusOr<SceneRecord> InsertScene(soci::session& sql, const SceneRecord& scene) {
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(scene.scene.project));
  if (!scene.request_id.empty()) {
    // A repeated request is found before the check for an existing scene, which is the one that it
    // made.
    const auto earlier = SelectScenes(sql, {of_project + "request_id =", scene.request_id});
    if (!earlier.empty() && earlier[0].scene.name == scene.scene.name &&
        earlier[0].display_name == scene.display_name) {
      return earlier[0];
    }
    if (!earlier.empty()) {
      return absl::AlreadyExistsError(absl::StrCat(
          "request_id '", scene.request_id, "' was used to create ", SceneName(earlier[0].scene)));
    }
  }
  if (!SelectScenes(sql, {of_project + "name =", scene.scene.name}).empty()) {
    return absl::AlreadyExistsError(absl::StrCat(SceneName(scene.scene), " exists already"));
  }
  SceneRecord row = scene;
  row.scene.id = TakeSceneId(sql);
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  sql << "INSERT INTO scenes (id, project, name, display_name, request_id, create_time,"
         " next_dataset, next_model) VALUES (:id, :project, :name, :display, :request, :time, 1,"
         " 1)",
      soci::use(row.scene.id), soci::use(row.scene.project), soci::use(row.scene.name),
      soci::use(row.display_name), soci::use(row.request_id), soci::use(now);
  return row;
}

absl::Status CheckSceneName(const std::string& name) {
  if (IsResourceId(name)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("scene id '", name, "': ", kResourceIdRule));
}

}  // namespace

absl::StatusOr<SceneRecord> SceneStore::CreateScene(const SceneRecord& scene) {
  RETURN_IF_ERROR(CheckSceneName(scene.scene.name));
  if (!IsRfc1034Label(scene.scene.project)) {
    return absl::InvalidArgumentError(
        absl::StrCat("project '", scene.scene.project, "' is not an RFC 1034 label"));
  }
  return database_.Query<SceneRecord>([&](soci::session& sql) { return InsertScene(sql, scene); });
}

absl::StatusOr<SceneRef> SceneStore::FindScene(const std::string& project,
                                               const std::string& name) {
  RETURN_IF_ERROR(CheckSceneName(name));
  return database_.Read<SceneRef>([&](soci::session& sql) -> absl::StatusOr<SceneRef> {
    SceneRef scene{0, project, name};
    sql << "SELECT id FROM scenes WHERE project = :project AND name = :name", soci::use(project),
        soci::use(name), soci::into(scene.id);
    if (!sql.got_data()) {
      return absl::NotFoundError(absl::StrCat(SceneName(scene), " does not exist"));
    }
    return scene;
  });
}

absl::StatusOr<std::vector<SceneRef>> SceneStore::FindScenes(const std::string& name) {
  // Enough for a message that lists the projects to choose from.
  constexpr int64_t kMost = 10;
  using Scenes = std::vector<SceneRef>;
  RETURN_IF_ERROR(CheckSceneName(name));
  return database_.Read<Scenes>([&](soci::session& sql) {
    Scenes scenes;
    for (SceneRecord& row : SelectScenes(sql, {"name =", name, kMost, "project"})) {
      scenes.push_back(std::move(row.scene));
    }
    return scenes;
  });
}

absl::StatusOr<SceneRecord> SceneStore::GetScene(const SceneRef& scene) {
  return database_.Read<SceneRecord>([&](soci::session& sql) -> absl::StatusOr<SceneRecord> {
    // Any name: the id alone decides.
    const auto found = SelectScenes(sql, {absl::StrCat("id = ", scene.id, " AND name >"), ""});
    if (!found.empty()) return found[0];
    return absl::NotFoundError(absl::StrCat(SceneName(scene), " does not exist"));
  });
}

absl::StatusOr<Page<SceneRecord>> SceneStore::ListScenes(const PageRequest& page,
                                                         const std::string& project) {
  const std::string list = absl::StrCat("scenes/", project);
  ASSIGN_OR_RETURN(const std::string of_project, OfProject(project));
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  return database_.Query<Page<SceneRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<SceneRecord>> {
        Page<SceneRecord> answer;
        // Scenes of several projects may have the same name. Order by name and project then, so
        // that a page token identifies one scene.
        const bool of_all = project.empty();
        const std::string order = of_all ? "name || ' ' || project" : "name";
        answer.records =
            SelectScenes(sql, {of_project + order + " >", start.key, start.limit + 1, order});
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          const SceneRef& last = answer.records.back().scene;
          const std::string key = of_all ? absl::StrCat(last.name, " ", last.project) : last.name;
          answer.next_page_token = NextToken(list, key);
        }
        return answer;
      });
}

absl::Status SceneStore::DeleteScene(const SceneRef& scene) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    // A worker would continue to write into the folder of a job that has no record.
    const JobRecord active = SelectActiveJob(sql, scene);
    if (!active.id.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat(SceneName(scene), " has an active job: cancel jobs/", active.id, " first"));
    }
    sql << "DELETE FROM scenes WHERE id = :id",
        soci::use(scene.id);  // records that refer to it are deleted by cascade
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
