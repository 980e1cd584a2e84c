#include "server/store/model_store.h"

#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

constexpr int64_t kNewestModel = std::numeric_limits<int64_t>::max();

// SQL for the dataset of a model's job, or 0. models.job is "j" and the number of the job, whose
// record exists as long as the scene.
constexpr char kDatasetOfJob[] =
    "COALESCE((SELECT dataset FROM jobs WHERE jobs.number = CAST(SUBSTR(models.job, 2) AS BIGINT)),"
    " 0)";

// Which models of a scene to select: those for which "number `condition` `key`" holds, in this
// order.
struct ModelQuery {
  std::string condition = "<";
  int64_t key = kNewestModel;
  int64_t limit = 1;
  std::string order = "number DESC";
};
std::vector<ModelRecord> SelectModels(soci::session& sql, const SceneRef& scene,
                                      const ModelQuery& query) {
  ModelRecord row;
  row.scene = scene;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT number, job, " << kDatasetOfJob
                   << ", device, folder, metrics, sources, num_gaussians,"
                      " num_bytes, create_time, made_from, edit FROM models"
                      " WHERE scene = :scene AND number "
                   << query.condition << " :key ORDER BY " << query.order << " LIMIT :limit",
       soci::into(row.number), soci::into(row.job), soci::into(row.dataset), soci::into(row.device),
       soci::into(row.folder), soci::into(row.metrics), soci::into(row.sources),
       soci::into(row.num_gaussians), soci::into(row.num_bytes), soci::into(create_time),
       soci::into(row.made_from), soci::into(row.edit), soci::use(scene.id), soci::use(query.key),
       soci::use(query.limit));
  select.execute();
  std::vector<ModelRecord> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

absl::Status NoModelError(soci::session& sql, const SceneRef& scene) {
  // The message says which job will make a model, since that is what the client wants to know next.
  const JobRecord active = SelectActiveJob(sql, scene);
  return absl::FailedPreconditionError(
      absl::StrCat(SceneName(scene), " has no model yet",
                   active.id.empty() ? ": train it first"
                                     : absl::StrCat(": jobs/", active.id, " is making one")));
}

// Two models that become live at once may have the same order: then the one with the higher number
// is live.
int64_t NextLiveOrder(soci::session& sql, const SceneRef& scene) {
  int64_t next = 0;
  sql << "SELECT COALESCE(MAX(live_order), 0) + 1 FROM models WHERE scene = :scene",
      soci::use(scene.id), soci::into(next);
  return next;
}

}  // namespace

absl::StatusOr<ModelRecord> SelectModel(soci::session& sql, const SceneRef& scene, int64_t number) {
  std::vector<ModelRecord> rows = SelectModels(sql, scene, {"=", number});
  if (rows.empty()) {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    return absl::NotFoundError(absl::StrCat(ChildName(scene, "models", number), " does not exist"));
  }
  return rows[0];
}

void InsertModel(soci::session& sql, const ModelRecord& row) {
  const int64_t now = ToMicros(row.create_time), order = NextLiveOrder(sql, row.scene);
  sql << "INSERT INTO models (scene, number, job, device, folder, metrics, sources, num_gaussians,"
         " num_bytes, create_time, live_order, made_from, edit) VALUES (:scene, :number, :job,"
         " :device, :folder, :metrics, :sources, :count, :bytes, :now, :live, :from, :edit)",
      soci::use(row.scene.id), soci::use(row.number), soci::use(row.job), soci::use(row.device),
      soci::use(row.folder), soci::use(row.metrics), soci::use(row.sources),
      soci::use(row.num_gaussians), soci::use(row.num_bytes), soci::use(now), soci::use(order),
      soci::use(row.made_from), soci::use(row.edit);
}

absl::StatusOr<int64_t> ModelStore::TakeModelNumber(const SceneRef& scene) {
  return database_.Query<int64_t>([&](soci::session& sql) -> absl::StatusOr<int64_t> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    return TakeNumber(sql, scene, "next_model");
  });
}

absl::StatusOr<ModelRecord> ModelStore::CreateVersion(const ModelRecord& model) {
  return database_.Query<ModelRecord>([&](soci::session& sql) -> absl::StatusOr<ModelRecord> {
    // It may have been deleted while the new one was computed.
    ASSIGN_OR_RETURN(const ModelRecord from, SelectModel(sql, model.scene, model.made_from));
    ModelRecord row = model;
    row.scene = from.scene;
    row.create_time = FromMicros(ToMicros(absl::Now()));
    InsertModel(sql, row);
    // After the insertion, so that the model counts. An error rolls it back.
    RETURN_IF_ERROR(CheckStoredBytes(sql, row.scene.project, defaults_));
    return row;
  });
}

absl::Status ModelStore::SetLiveModel(const SceneRef& scene, int64_t number) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(const ModelRecord model, SelectModel(sql, scene, number));
    const int64_t order = NextLiveOrder(sql, model.scene);
    sql << "UPDATE models SET live_order = :live WHERE scene = :scene AND number = :number",
        soci::use(order), soci::use(model.scene.id), soci::use(number);
    return absl::OkStatus();
  });
}

absl::StatusOr<ModelRecord> ModelStore::GetModel(const SceneRef& scene, int64_t number) {
  return database_.Read<ModelRecord>(
      [&](soci::session& sql) { return SelectModel(sql, scene, number); });
}

absl::StatusOr<ModelRecord> ModelStore::GetLiveModel(const SceneRef& scene) {
  return database_.Read<ModelRecord>([&](soci::session& sql) -> absl::StatusOr<ModelRecord> {
    std::vector<ModelRecord> rows =
        SelectModels(sql, scene, {.order = "live_order DESC, number DESC"});
    if (!rows.empty()) return rows[0];  // one SELECT: every query looks up its model here
    RETURN_IF_ERROR(CheckScene(sql, scene));
    return NoModelError(sql, scene);
  });
}

absl::StatusOr<Page<ModelRecord>> ModelStore::ListModels(const SceneRef& scene,
                                                         const PageRequest& page) {
  const std::string list = absl::StrCat("models/", scene.id);
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  ASSIGN_OR_RETURN(const int64_t key, NumberKey(start, kNewestModel));
  return database_.Query<Page<ModelRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<ModelRecord>> {
        RETURN_IF_ERROR(CheckScene(sql, scene));
        Page<ModelRecord> answer;
        // One more than the page has: if it is there, the page has a successor, and the token names
        // the last model shown. So a page costs no COUNT.
        answer.records = SelectModels(sql, scene, {"<", key, start.limit + 1});
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, absl::StrCat(answer.records.back().number));
        }
        return answer;
      });
}

absl::Status ModelStore::DeleteModel(const SceneRef& scene, int64_t number) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    // In the same transaction as the deletion, so that of two deletions one is NOT_FOUND.
    ASSIGN_OR_RETURN(const ModelRecord model, SelectModel(sql, scene, number));
    sql << "DELETE FROM models WHERE scene = :scene AND number = :number",
        soci::use(model.scene.id),
        soci::use(number);  // its selections are deleted by cascade
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
