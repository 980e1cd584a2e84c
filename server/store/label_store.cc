#include "server/store/label_store.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/resource_id.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxLabelsNamed = 20;  // in an error message

// Returns labels of a scene for which `condition`, followed by the start's key, holds, ordered by
// id.
std::vector<LabelRecord> SelectLabels(soci::session& sql, const SceneRef& scene,
                                      const std::string& condition, const PageStart& start) {
  LabelRecord row;
  row.scene = scene;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT id, text, view, width, height, counts, area, request_id,"
                      " create_time FROM labels WHERE scene = :scene AND "
                   << condition << " :key ORDER BY id LIMIT :limit",
       soci::into(row.id), soci::into(row.text), soci::into(row.view), soci::into(row.width),
       soci::into(row.height), soci::into(row.counts), soci::into(row.area),
       soci::into(row.request_id), soci::into(create_time), soci::use(scene.id),
       soci::use(start.key), soci::use(start.limit));
  select.execute();
  std::vector<LabelRecord> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

absl::Status NoLabelError(soci::session& sql, const SceneRef& scene, const std::string& id) {
  std::vector<std::string> ids;
  // A mistyped label is the usual error, so the message lists those that exist.
  for (const LabelRecord& label : SelectLabels(sql, scene, "id >", {kMaxLabelsNamed, ""})) {
    ids.push_back(label.id);
  }
  return absl::NotFoundError(
      absl::StrCat(LabelName(scene, id), " does not exist; ",
                   ids.empty() ? "the scene has no labels" : "the scene has ",
                   absl::StrJoin(ids, ", "), ids.size() == kMaxLabelsNamed ? " and others" : ""));
}

absl::StatusOr<LabelRecord> SelectLabel(soci::session& sql, const SceneRef& scene,
                                        const std::string& id) {
  RETURN_IF_ERROR(CheckScene(sql, scene));
  const std::vector<LabelRecord> rows = SelectLabels(sql, scene, "id =", {1, id});
  if (rows.empty()) return NoLabelError(sql, scene, id);
  return rows[0];
}

// The area is left out: it is in the pixels of the request's frame, which may differ between a
// request and its retry.
bool SameLabel(const LabelRecord& a, const LabelRecord& b) {
  return a.id == b.id && a.text == b.text && a.view == b.view && a.width == b.width &&
         a.height == b.height && a.counts == b.counts;
}

absl::StatusOr<LabelRecord> InsertLabel(soci::session& sql, const LabelRecord& label) {
  RETURN_IF_ERROR(CheckScene(sql, label.scene));
  if (!label.request_id.empty()) {
    const auto earlier = SelectLabels(sql, label.scene, "request_id =", {1, label.request_id});
    if (!earlier.empty() && SameLabel(earlier[0], label)) return earlier[0];
    if (!earlier.empty()) {
      return absl::AlreadyExistsError(
          absl::StrCat("request_id '", label.request_id, "' was used to create ",
                       LabelName(label.scene, earlier[0].id), ", of another view, mask or text"));
    }
  }
  if (!SelectLabels(sql, label.scene, "id =", {1, label.id}).empty()) {
    return absl::AlreadyExistsError(
        absl::StrCat(LabelName(label.scene, label.id), " exists already"));
  }
  LabelRecord row = label;
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  sql << "INSERT INTO labels (scene, id, text, view, width, height, counts, area, request_id,"
         " create_time) VALUES (:scene, :id, :text, :view, :width, :height, :counts, :area,"
         " :request, :now)",
      soci::use(row.scene.id), soci::use(row.id), soci::use(row.text), soci::use(row.view),
      soci::use(row.width), soci::use(row.height), soci::use(row.counts), soci::use(row.area),
      soci::use(row.request_id), soci::use(now);
  return row;
}

}  // namespace

absl::StatusOr<LabelRecord> LabelStore::CreateLabel(const LabelRecord& label) {
  if (!IsResourceId(label.id)) {
    return absl::InvalidArgumentError(absl::StrCat("label id '", label.id, "': ", kResourceIdRule));
  }
  return database_.Query<LabelRecord>([&](soci::session& sql) { return InsertLabel(sql, label); });
}

absl::StatusOr<LabelRecord> LabelStore::GetLabel(const SceneRef& scene, const std::string& id) {
  return database_.Query<LabelRecord>(
      [&](soci::session& sql) { return SelectLabel(sql, scene, id); });
}

absl::StatusOr<Page<LabelRecord>> LabelStore::ListLabels(const SceneRef& scene,
                                                         const PageRequest& page) {
  const std::string list = absl::StrCat("labels/", scene.id);
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  return database_.Query<Page<LabelRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<LabelRecord>> {
        RETURN_IF_ERROR(CheckScene(sql, scene));
        Page<LabelRecord> answer;
        answer.records = SelectLabels(sql, scene, "id >", {start.limit + 1, start.key});
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, answer.records.back().id);
        }
        return answer;
      });
}

absl::Status LabelStore::DeleteLabel(const SceneRef& scene, const std::string& id) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(const LabelRecord label, SelectLabel(sql, scene, id));
    sql << "DELETE FROM labels WHERE scene = :scene AND id = :id", soci::use(label.scene.id),
        soci::use(label.id);
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
