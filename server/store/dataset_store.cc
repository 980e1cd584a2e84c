#include "server/store/dataset_store.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/quota.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

// Returns datasets of a scene for which "number `condition` `key`" holds, ordered by number.
std::vector<DatasetRecord> SelectDatasets(soci::session& sql, const SceneRef& scene,
                                          const std::string& condition, int64_t key,
                                          int64_t limit) {
  DatasetRecord row;
  row.scene = scene;
  int state = 0;
  int64_t create_time = 0;
  int64_t seal_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT number, state, request_id, create_time, seal_time, num_files,"
                      " num_bytes FROM datasets WHERE scene = :scene AND number "
                   << condition << " :key ORDER BY number LIMIT :limit",
       soci::into(row.number), soci::into(state), soci::into(row.request_id),
       soci::into(create_time), soci::into(seal_time), soci::into(row.num_files),
       soci::into(row.num_bytes), soci::use(scene.id), soci::use(key), soci::use(limit));
  select.execute();
  std::vector<DatasetRecord> rows;
  while (select.fetch()) {
    row.state = static_cast<DatasetState>(state);
    row.create_time = FromMicros(create_time);
    row.seal_time = FromMicros(seal_time);
    rows.push_back(row);
  }
  return rows;
}

// Returns whether two lists declare the same files, in any order.
bool SameFiles(std::vector<DatasetFileRecord> a, std::vector<DatasetFileRecord> b) {
  const auto by_path = [](const DatasetFileRecord& x, const DatasetFileRecord& y) {
    return x.path < y.path;
  };
  std::sort(a.begin(), a.end(), by_path);
  std::sort(b.begin(), b.end(), by_path);
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const DatasetFileRecord& x, const DatasetFileRecord& y) {
                      return x.path == y.path && x.kind == y.kind && x.size == y.size &&
                             x.sha256 == y.sha256;
                    });
}

// Returns the dataset that an earlier call with this request_id made; its number is 0 if there was
// none. ALREADY_EXISTS: it has other files.
absl::StatusOr<DatasetRecord> FindEarlier(soci::session& sql, const DatasetRecord& wanted,
                                          const std::vector<DatasetFileRecord>& files) {
  if (wanted.request_id.empty()) return DatasetRecord();
  int64_t number = 0;
  sql << "SELECT number FROM datasets WHERE scene = :scene AND request_id = :request",
      soci::use(wanted.scene.id), soci::use(wanted.request_id), soci::into(number);
  if (!sql.got_data()) return DatasetRecord();
  FileQuery query;
  query.scene = wanted.scene;
  query.dataset = number;
  if (!SameFiles(SelectFiles(sql, query), files)) {
    return absl::AlreadyExistsError(
        absl::StrCat("request_id '", wanted.request_id, "' was used to create ",
                     ChildName(wanted.scene, "datasets", number), " of other files"));
  }
  return SelectDataset(sql, wanted.scene, number);
}

DatasetRecord InsertDataset(soci::session& sql, DatasetRecord row,
                            const std::vector<DatasetFileRecord>& files) {
  row.number = TakeNumber(sql, row.scene, "next_dataset");
  row.num_files = static_cast<int64_t>(files.size());
  for (const DatasetFileRecord& file : files) row.num_bytes += file.size;
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  row.seal_time = FromMicros(0);
  sql << "INSERT INTO datasets (scene, number, state, request_id, create_time, seal_time,"
         " num_files, num_bytes) VALUES (:scene, :number, 0, :request, :time, 0, :files, :bytes)",
      soci::use(row.scene.id), soci::use(row.number), soci::use(row.request_id), soci::use(now),
      soci::use(row.num_files), soci::use(row.num_bytes);
  InsertFiles(sql, row, files);
  return row;
}

// Seals a dataset unless a file is missing.
absl::StatusOr<DatasetRecord> Seal(soci::session& sql, const DatasetRecord& dataset) {
  if (dataset.state == DatasetState::kSealed) return dataset;
  FileQuery query;
  query.scene = dataset.scene;
  query.dataset = dataset.number;
  // The key is empty here, so "path <> ''" holds for every file.
  query.condition = "stored = 0 AND path <>";
  const std::vector<DatasetFileRecord> missing = SelectFiles(sql, query);
  if (!missing.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        ChildName(dataset.scene, "datasets", dataset.number), ": ", missing.size(), " of ",
        dataset.num_files, " files are not uploaded, the first is '", missing[0].path, "'"));
  }
  const int64_t now = absl::ToUnixMicros(absl::Now());
  sql << "UPDATE datasets SET state = 1, seal_time = :now WHERE scene = :scene AND number = :n",
      soci::use(now), soci::use(dataset.scene.id), soci::use(dataset.number);
  return SelectDataset(sql, dataset.scene, dataset.number);
}

}  // namespace

absl::StatusOr<DatasetRecord> SelectDataset(soci::session& sql, const SceneRef& scene,
                                            int64_t number) {
  RETURN_IF_ERROR(CheckScene(sql, scene));
  std::vector<DatasetRecord> rows = SelectDatasets(sql, scene, "=", number, 1);
  if (rows.empty()) {
    return absl::NotFoundError(
        absl::StrCat(ChildName(scene, "datasets", number), " does not exist"));
  }
  return rows[0];
}

absl::StatusOr<DatasetRecord> DatasetStore::CreateDataset(
    const SceneRef& scene, const std::string& request_id,
    const std::vector<DatasetFileRecord>& files, const std::function<absl::Status()>& admit) {
  DatasetRecord row;
  row.scene = scene;
  row.request_id = request_id;
  return database_.Query<DatasetRecord>([&](soci::session& sql) -> absl::StatusOr<DatasetRecord> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    ASSIGN_OR_RETURN(const DatasetRecord earlier, FindEarlier(sql, row, files));
    if (earlier.number != 0) return earlier;
    // Only for a new dataset: a retry of a call that succeeded must not fail because the disk has
    // filled up.
    if (admit) RETURN_IF_ERROR(admit());
    const DatasetRecord made = InsertDataset(sql, row, files);
    std::vector<DatasetFileRecord> stored;
    std::copy_if(files.begin(), files.end(), std::back_inserter(stored),
                 [](const DatasetFileRecord& file) { return file.stored; });
    // Files whose bytes are there already count as stored from now on. The blob may have no record,
    // for example if the server was killed after publishing it.
    InsertBlobs(sql, scene.project, stored);
    // Checked after the insertion, so that the dataset counts. An error rolls all of it back.
    RETURN_IF_ERROR(CheckUploadQuotas(sql, scene.project, defaults_));
    return made;
  });
}

absl::StatusOr<DatasetRecord> DatasetStore::GetDataset(const SceneRef& scene, int64_t number) {
  return database_.Query<DatasetRecord>(
      [&](soci::session& sql) { return SelectDataset(sql, scene, number); });
}

absl::StatusOr<Page<DatasetRecord>> DatasetStore::ListDatasets(const SceneRef& scene,
                                                               const PageRequest& page) {
  const std::string list = absl::StrCat("datasets/", scene.id);
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  ASSIGN_OR_RETURN(const int64_t key, NumberKey(start, 0));
  return database_.Query<Page<DatasetRecord>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<DatasetRecord>> {
        RETURN_IF_ERROR(CheckScene(sql, scene));
        Page<DatasetRecord> answer;
        answer.records =
            // Only sealed datasets: an open one is an upload.
            SelectDatasets(sql, scene, "> 0 AND state = 1 AND number >", key, start.limit + 1);
        if (static_cast<int64_t>(answer.records.size()) > start.limit) {
          answer.records.pop_back();
          answer.next_page_token = NextToken(list, absl::StrCat(answer.records.back().number));
        }
        return answer;
      });
}

absl::StatusOr<DatasetRecord> DatasetStore::SealDataset(
    const SceneRef& scene, int64_t number, const std::vector<DatasetFileRecord>& found) {
  return database_.Query<DatasetRecord>([&](soci::session& sql) -> absl::StatusOr<DatasetRecord> {
    ASSIGN_OR_RETURN(const DatasetRecord dataset, SelectDataset(sql, scene, number));
    if (dataset.state == DatasetState::kOpen) {
      InsertBlobs(sql, scene.project, found);
      RETURN_IF_ERROR(MarkStored(sql, dataset, found));
    }
    return Seal(sql, dataset);
  });
}

absl::StatusOr<std::vector<DatasetRecord>> DatasetStore::ListOpenUploads(
    absl::Time created_before) {
  using Rows = std::vector<DatasetRecord>;
  return database_.Query<Rows>([&](soci::session& sql) -> absl::StatusOr<Rows> {
    const int64_t before = ToMicros(created_before);
    DatasetRecord row;
    int64_t create_time = 0;
    soci::statement select =
        (sql.prepare << "SELECT s.id, s.project, s.name, d.number, d.create_time, d.num_files,"
                        " d.num_bytes FROM datasets d JOIN scenes s ON s.id = d.scene"
                        " WHERE d.state = 0 AND d.create_time < :before ORDER BY s.id, d.number",
         soci::into(row.scene.id), soci::into(row.scene.project), soci::into(row.scene.name),
         soci::into(row.number), soci::into(create_time), soci::into(row.num_files),
         soci::into(row.num_bytes), soci::use(before));
    select.execute();
    Rows rows;
    while (select.fetch()) {
      row.create_time = FromMicros(create_time);
      rows.push_back(row);
    }
    return rows;
  });
}

absl::Status DatasetStore::DeleteUpload(const SceneRef& scene, int64_t number) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(const DatasetRecord dataset, SelectDataset(sql, scene, number));
    // An upload may be sealed between the collector's look at its age and this transaction.
    if (dataset.state == DatasetState::kSealed) {
      return absl::FailedPreconditionError(
          absl::StrCat(ChildName(scene, "uploads", number), " is sealed"));
    }
    sql << "DELETE FROM datasets WHERE scene = :scene AND number = :number",
        soci::use(dataset.scene.id), soci::use(number);  // its files are deleted by cascade
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
