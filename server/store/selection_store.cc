#include "server/store/selection_store.h"

#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/quota.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

constexpr int64_t kNewestSelection = std::numeric_limits<int64_t>::max();

// Returns selections of a scene for which "number `condition` `key`" holds, newest first.
std::vector<SelectionRecord> SelectSelections(soci::session& sql, const SceneRef& scene,
                                              const std::string& condition, const PageStart& start,
                                              int64_t key) {
  SelectionRecord row;
  row.scene = scene;
  int64_t create_time = 0;
  soci::statement select =
      (sql.prepare
           << "SELECT number, model, model_gaussians, num_gaussians, min_x, min_y,"
              " min_z, max_x, max_y, max_z, base, display_name, file, num_bytes, request_id,"
              " request_digest, create_time FROM selections WHERE scene = :scene AND number "
           << condition << " :key ORDER BY number DESC LIMIT :limit",
       soci::into(row.number), soci::into(row.model), soci::into(row.model_gaussians),
       soci::into(row.num_gaussians), soci::into(row.min[0]), soci::into(row.min[1]),
       soci::into(row.min[2]), soci::into(row.max[0]), soci::into(row.max[1]),
       soci::into(row.max[2]), soci::into(row.base), soci::into(row.display_name),
       soci::into(row.file), soci::into(row.num_bytes), soci::into(row.request_id),
       soci::into(row.request_digest), soci::into(create_time), soci::use(scene.id), soci::use(key),
       soci::use(start.limit));
  select.execute();
  std::vector<SelectionRecord> rows;
  while (select.fetch()) {
    row.create_time = FromMicros(create_time);
    rows.push_back(row);
  }
  return rows;
}

absl::StatusOr<SelectionRecord> SelectSelection(soci::session& sql, const SceneRef& scene,
                                                int64_t number) {
  RETURN_IF_ERROR(CheckScene(sql, scene));
  const std::vector<SelectionRecord> rows = SelectSelections(sql, scene, "=", {1, ""}, number);
  if (rows.empty()) {
    return absl::NotFoundError(
        absl::StrCat(ChildName(scene, "selections", number), " does not exist"));
  }
  return rows[0];
}

// Returns the selection that an earlier call with this request_id made, or nullopt. ALREADY_EXISTS:
// the earlier request had another digest.
absl::StatusOr<std::optional<SelectionRecord>> FindEarlier(soci::session& sql,
                                                           const SceneRef& scene,
                                                           const std::string& request_id,
                                                           const std::string& request_digest) {
  if (request_id.empty()) return std::nullopt;
  int64_t number = 0;
  sql << "SELECT number FROM selections WHERE scene = :scene AND request_id = :request",
      soci::use(scene.id), soci::use(request_id), soci::into(number);
  if (!sql.got_data()) return std::nullopt;
  ASSIGN_OR_RETURN(SelectionRecord earlier, SelectSelection(sql, scene, number));
  if (earlier.request_digest == request_digest) return earlier;
  return absl::AlreadyExistsError(absl::StrCat("request_id '", request_id, "' was used to create ",
                                               ChildName(scene, "selections", number),
                                               " by asking for something else"));
}

absl::StatusOr<SelectionRecord> InsertSelection(soci::session& sql,
                                                const SelectionRecord& selection,
                                                const Quota& defaults) {
  // The model or the base may have been deleted while the selection was computed.
  RETURN_IF_ERROR(SelectModel(sql, selection.scene, selection.model).status());
  ASSIGN_OR_RETURN(const auto earlier, FindEarlier(sql, selection.scene, selection.request_id,
                                                   selection.request_digest));
  if (earlier.has_value()) return *earlier;
  if (selection.base != 0) {
    RETURN_IF_ERROR(SelectSelection(sql, selection.scene, selection.base).status());
  }
  SelectionRecord row = selection;
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  sql << "INSERT INTO selections (scene, number, model, model_gaussians, num_gaussians, min_x,"
         " min_y, min_z, max_x, max_y, max_z, base, display_name, file, num_bytes, request_id,"
         " request_digest, create_time)"
         " VALUES (:scene, :number, :model, :all, :num, :min_x, :min_y, :min_z, :max_x, :max_y,"
         " :max_z, :base, :display, :file, :bytes, :request, :digest, :now)",
      soci::use(row.scene.id), soci::use(row.number), soci::use(row.model),
      soci::use(row.model_gaussians), soci::use(row.num_gaussians), soci::use(row.min[0]),
      soci::use(row.min[1]), soci::use(row.min[2]), soci::use(row.max[0]), soci::use(row.max[1]),
      soci::use(row.max[2]), soci::use(row.base), soci::use(row.display_name), soci::use(row.file),
      soci::use(row.num_bytes), soci::use(row.request_id), soci::use(row.request_digest),
      soci::use(now);
  // After the insertion, so that the selection counts. An error rolls it back.
  RETURN_IF_ERROR(CheckStoredBytes(sql, row.scene.project, defaults));
  return row;
}

}  // namespace

absl::StatusOr<int64_t> SelectionStore::TakeSelectionNumber(const SceneRef& scene) {
  return database_.Query<int64_t>([&](soci::session& sql) -> absl::StatusOr<int64_t> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    return TakeNumber(sql, scene, "next_selection");
  });
}

absl::StatusOr<std::optional<SelectionRecord>> SelectionStore::FindSelectionOfRequest(
    const SceneRef& scene, const std::string& request_id, const std::string& request_digest) {
  using Found = std::optional<SelectionRecord>;
  return database_.Query<Found>([&](soci::session& sql) -> absl::StatusOr<Found> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    return FindEarlier(sql, scene, request_id, request_digest);
  });
}

absl::StatusOr<SelectionRecord> SelectionStore::CreateSelection(const SelectionRecord& selection) {
  return database_.Query<SelectionRecord>(
      [&](soci::session& sql) { return InsertSelection(sql, selection, defaults_); });
}

absl::StatusOr<SelectionRecord> SelectionStore::GetSelection(const SceneRef& scene,
                                                             int64_t number) {
  return database_.Query<SelectionRecord>(
      [&](soci::session& sql) { return SelectSelection(sql, scene, number); });
}

absl::StatusOr<Page<SelectionRecord>> SelectionStore::ListSelections(const SceneRef& scene,
                                                                     const PageRequest& page) {
  const std::string list = absl::StrCat("selections/", scene.id);
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  ASSIGN_OR_RETURN(const int64_t key, NumberKey(start, kNewestSelection));
  return database_.Query<Page<SelectionRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<SelectionRecord>> {
        RETURN_IF_ERROR(CheckScene(sql, scene));
        Page<SelectionRecord> answer;
        answer.records = SelectSelections(sql, scene, "<", {start.limit + 1, ""}, key);
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, absl::StrCat(answer.records.back().number));
        }
        return answer;
      });
}

absl::Status SelectionStore::DeleteSelection(const SceneRef& scene, int64_t number) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(const SelectionRecord row, SelectSelection(sql, scene, number));
    sql << "DELETE FROM selections WHERE scene = :scene AND number = :number",
        soci::use(row.scene.id), soci::use(row.number);
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
