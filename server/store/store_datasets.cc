#include <algorithm>
#include <iterator>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/batch_statement.h"
#include "server/store/database.h"
#include "server/store/quota_sql.h"
#include "server/store/store.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

std::string DatasetName(const std::string& scene, int64_t number) {
  return absl::StrCat("scenes/", scene, "/datasets/", number);
}

// Datasets of a scene for which `condition` on `key` holds, by number.
std::vector<DatasetRow> SelectDatasets(soci::session& sql, const std::string& scene,
                                       const std::string& condition, int64_t key, int64_t limit) {
  DatasetRow row;
  int state = 0;
  int64_t create_time = 0;
  int64_t seal_time = 0;
  soci::statement select =
      (sql.prepare << "SELECT scene, number, state, request_id, create_time, seal_time, num_files,"
                      " num_bytes FROM datasets WHERE scene = :scene AND number "
                   << condition << " :key ORDER BY number LIMIT :limit",
       soci::into(row.scene), soci::into(row.number), soci::into(state), soci::into(row.request_id),
       soci::into(create_time), soci::into(seal_time), soci::into(row.num_files),
       soci::into(row.num_bytes), soci::use(scene), soci::use(key), soci::use(limit));
  select.execute();
  std::vector<DatasetRow> rows;
  while (select.fetch()) {
    row.state = static_cast<DatasetState>(state);
    row.create_time = FromMicros(create_time);
    row.seal_time = FromMicros(seal_time);
    rows.push_back(row);
  }
  return rows;
}

constexpr int64_t kAllFiles = std::numeric_limits<int64_t>::max();

// Files of a dataset for which `condition` on `key` holds, by path.
struct FileQuery {
  std::string scene;
  int64_t dataset = 0;
  std::string condition = "path <>";
  std::string key = {};
  int64_t limit = kAllFiles;
};

std::vector<DatasetFileRow> SelectFiles(soci::session& sql, const FileQuery& query) {
  DatasetFileRow row;
  int stored = 0;
  int header = 0;
  soci::statement select =
      (sql.prepare << "SELECT path, kind, size, sha256, stored, header, width, height, num_points"
                      " FROM dataset_files WHERE scene = :scene AND dataset = :dataset AND "
                   << query.condition << " :key ORDER BY path LIMIT :limit",
       soci::into(row.path), soci::into(row.kind), soci::into(row.size), soci::into(row.sha256),
       soci::into(stored), soci::into(header), soci::into(row.width), soci::into(row.height),
       soci::into(row.num_points), soci::use(query.scene), soci::use(query.dataset),
       soci::use(query.key), soci::use(query.limit));
  select.execute();
  std::vector<DatasetFileRow> rows;
  while (select.fetch()) {
    row.stored = stored != 0;
    row.header = static_cast<HeaderState>(header);
    rows.push_back(row);
  }
  return rows;
}

void InsertFiles(soci::session& sql, const DatasetRow& dataset,
                 const std::vector<DatasetFileRow>& files) {
  BatchStatement insert(
      sql, {"INSERT INTO dataset_files (scene, dataset, path, kind, size, sha256, stored) VALUES ",
            "(CAST(? AS VARCHAR(83)), CAST(? AS BIGINT), CAST(? AS TEXT), CAST(? AS INTEGER),"
            " CAST(? AS BIGINT), CAST(? AS VARCHAR(64)), CAST(? AS INTEGER))",
            ", ", ""});
  for (const DatasetFileRow& file : files) {
    insert.Add({dataset.scene, dataset.number, file.path, int64_t{file.kind}, file.size,
                file.sha256, int64_t{file.stored ? 1 : 0}});
  }
  insert.Finish();
}

// They are on the disk.
void InsertBlobs(soci::session& sql, const std::string& project,
                 const std::vector<DatasetFileRow>& files) {
  BatchStatement insert(sql, {"INSERT INTO blobs (project, sha256, size) VALUES ",
                              "(CAST(? AS VARCHAR(63)), CAST(? AS VARCHAR(64)), CAST(? AS BIGINT))",
                              ", ", " ON CONFLICT (project, sha256) DO NOTHING"});
  for (const DatasetFileRow& file : files) insert.Add({project, file.sha256, file.size});
  insert.Finish();
}

// Sets columns of files of a dataset by their path and digest, from values that `v` has. Returns
// how many it has found.
int64_t UpdateFiles(soci::session& sql, const std::string& columns, const DatasetRow& dataset,
                    const std::vector<DatasetFileRow>& files) {
  BatchStatement update(
      sql, {"UPDATE dataset_files SET " + columns + " FROM (",
            "SELECT CAST(? AS VARCHAR(83)) AS scene, CAST(? AS BIGINT) AS dataset,"
            " CAST(? AS TEXT) AS path, CAST(? AS VARCHAR(64)) AS sha256,"
            " CAST(? AS INTEGER) AS header, CAST(? AS INTEGER) AS width,"
            " CAST(? AS INTEGER) AS height, CAST(? AS BIGINT) AS num_points",
            " UNION ALL ",
            ") AS v WHERE dataset_files.scene = v.scene AND dataset_files.dataset = v.dataset AND"
            " dataset_files.path = v.path AND dataset_files.sha256 = v.sha256"});
  for (const DatasetFileRow& file : files) {
    update.Add({dataset.scene, dataset.number, file.path, file.sha256,
                static_cast<int64_t>(file.header), int64_t{file.width}, int64_t{file.height},
                file.num_points});
  }
  return update.Finish();
}

constexpr char kHeaderColumns[] =
    "header = v.header, width = v.width, height = v.height, num_points = v.num_points";

absl::Status MarkStored(soci::session& sql, const DatasetRow& dataset,
                        const std::vector<DatasetFileRow>& files) {
  const std::string columns = absl::StrCat("stored = 1, ", kHeaderColumns);
  const int64_t num_found = UpdateFiles(sql, columns, dataset, files);
  if (num_found == static_cast<int64_t>(files.size())) return absl::OkStatus();
  return absl::NotFoundError(absl::StrCat(DatasetName(dataset.scene, dataset.number), " has ",
                                          num_found, " of the ", files.size(),
                                          " files that were written"));
}

bool SameFiles(std::vector<DatasetFileRow> a, std::vector<DatasetFileRow> b) {
  const auto by_path = [](const DatasetFileRow& x, const DatasetFileRow& y) {
    return x.path < y.path;
  };
  std::sort(a.begin(), a.end(), by_path);
  std::sort(b.begin(), b.end(), by_path);
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(), [](const DatasetFileRow& x, const DatasetFileRow& y) {
        return x.path == y.path && x.kind == y.kind && x.size == y.size && x.sha256 == y.sha256;
      });
}

// What an earlier call with this request_id made; number 0: there was none.
absl::StatusOr<DatasetRow> FindEarlier(soci::session& sql, const DatasetRow& wanted,
                                       const std::vector<DatasetFileRow>& files) {
  if (wanted.request_id.empty()) return DatasetRow();
  int64_t number = 0;
  sql << "SELECT number FROM datasets WHERE scene = :scene AND request_id = :request",
      soci::use(wanted.scene), soci::use(wanted.request_id), soci::into(number);
  if (!sql.got_data()) return DatasetRow();
  FileQuery query;
  query.scene = wanted.scene;
  query.dataset = number;
  if (!SameFiles(SelectFiles(sql, query), files)) {
    return absl::AlreadyExistsError(
        absl::StrCat("request_id '", wanted.request_id, "' was used to create ",
                     DatasetName(wanted.scene, number), " of other files"));
  }
  return SelectDataset(sql, wanted.scene, number);
}

DatasetRow InsertDataset(soci::session& sql, DatasetRow row,
                         const std::vector<DatasetFileRow>& files) {
  row.number = TakeNumber(sql, row.scene, "next_dataset");
  row.num_files = static_cast<int64_t>(files.size());
  for (const DatasetFileRow& file : files) row.num_bytes += file.size;
  const int64_t now = absl::ToUnixMicros(absl::Now());
  row.create_time = FromMicros(now);
  row.seal_time = FromMicros(0);
  sql << "INSERT INTO datasets (scene, number, state, request_id, create_time, seal_time,"
         " num_files, num_bytes) VALUES (:scene, :number, 0, :request, :time, 0, :files, :bytes)",
      soci::use(row.scene), soci::use(row.number), soci::use(row.request_id), soci::use(now),
      soci::use(row.num_files), soci::use(row.num_bytes);
  InsertFiles(sql, row, files);
  return row;
}

absl::StatusOr<DatasetRow> Seal(soci::session& sql, const DatasetRow& dataset) {
  if (dataset.state == DatasetState::kSealed) return dataset;
  FileQuery query;
  query.scene = dataset.scene;
  query.dataset = dataset.number;
  query.condition = "stored = 0 AND path <>";
  const std::vector<DatasetFileRow> missing = SelectFiles(sql, query);
  if (!missing.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        DatasetName(dataset.scene, dataset.number), ": ", missing.size(), " of ", dataset.num_files,
        " files are not uploaded, the first is '", missing[0].path, "'"));
  }
  const int64_t now = absl::ToUnixMicros(absl::Now());
  sql << "UPDATE datasets SET state = 1, seal_time = :now WHERE scene = :scene AND number = :n",
      soci::use(now), soci::use(dataset.scene), soci::use(dataset.number);
  return SelectDataset(sql, dataset.scene, dataset.number);
}

}  // namespace

absl::StatusOr<DatasetRow> SelectDataset(soci::session& sql, const std::string& scene,
                                         int64_t number) {
  RETURN_IF_ERROR(CheckScene(sql, scene));
  std::vector<DatasetRow> rows = SelectDatasets(sql, scene, "=", number, 1);
  if (rows.empty()) {
    return absl::NotFoundError(absl::StrCat(DatasetName(scene, number), " does not exist"));
  }
  return rows[0];
}

absl::StatusOr<DatasetRow> Store::CreateDataset(const std::string& scene,
                                                const std::string& request_id,
                                                const std::vector<DatasetFileRow>& files,
                                                const std::function<absl::Status()>& admit) {
  DatasetRow row;
  row.scene = scene;
  row.request_id = request_id;
  return database_->Query<DatasetRow>([&](soci::session& sql) -> absl::StatusOr<DatasetRow> {
    RETURN_IF_ERROR(CheckScene(sql, scene));
    ASSIGN_OR_RETURN(const DatasetRow earlier, FindEarlier(sql, row, files));
    if (earlier.number != 0) return earlier;
    if (admit) RETURN_IF_ERROR(admit());
    const DatasetRow made = InsertDataset(sql, row, files);
    std::vector<DatasetFileRow> stored;
    std::copy_if(files.begin(), files.end(), std::back_inserter(stored),
                 [](const DatasetFileRow& file) { return file.stored; });
    InsertBlobs(sql, SelectProjectOf(sql, scene), stored);
    // After it, so that it counts too: when that is too much, all of it is undone.
    RETURN_IF_ERROR(CheckUploadQuotas(sql, scene, default_quota_));
    return made;
  });
}

absl::StatusOr<DatasetRow> Store::GetDataset(const std::string& scene, int64_t number) {
  return database_->Query<DatasetRow>(
      [&](soci::session& sql) { return SelectDataset(sql, scene, number); });
}

absl::StatusOr<Page<DatasetRow>> Store::ListDatasets(const std::string& scene,
                                                     const PageRequest& page) {
  const std::string list = absl::StrCat("datasets/", scene);
  ASSIGN_OR_RETURN(const PageStart start, StartPage(list, page));
  ASSIGN_OR_RETURN(const int64_t key, NumberKey(start, 0));
  return database_->Query<Page<DatasetRow>>(
      [&](soci::session& sql) -> absl::StatusOr<Page<DatasetRow>> {
        RETURN_IF_ERROR(CheckScene(sql, scene));
        Page<DatasetRow> answer;
        answer.rows =
            SelectDatasets(sql, scene, "> 0 AND state = 1 AND number >", key, start.limit + 1);
        if (static_cast<int64_t>(answer.rows.size()) > start.limit) {
          answer.rows.pop_back();
          answer.next_page_token = NextToken(list, absl::StrCat(answer.rows.back().number));
        }
        return answer;
      });
}

absl::StatusOr<std::vector<DatasetFileRow>> Store::ListDatasetFiles(const std::string& scene,
                                                                    int64_t number) {
  using Files = std::vector<DatasetFileRow>;
  return database_->Query<Files>([&](soci::session& sql) -> absl::StatusOr<Files> {
    ASSIGN_OR_RETURN(const DatasetRow dataset, SelectDataset(sql, scene, number));
    FileQuery query;
    query.scene = dataset.scene;
    query.dataset = number;
    return SelectFiles(sql, query);
  });
}

absl::StatusOr<DatasetFileRow> Store::GetDatasetFile(const std::string& scene, int64_t number,
                                                     const std::string& path) {
  return database_->Query<DatasetFileRow>([&](soci::session& sql)
                                              -> absl::StatusOr<DatasetFileRow> {
    ASSIGN_OR_RETURN(const DatasetRow dataset, SelectDataset(sql, scene, number));
    std::vector<DatasetFileRow> rows = SelectFiles(sql, {dataset.scene, number, "path =", path, 1});
    if (rows.empty()) {
      return absl::NotFoundError(
          absl::StrCat(DatasetName(scene, number), " has no file '", path, "'"));
    }
    return rows[0];
  });
}

absl::StatusOr<bool> Store::HasFileOfKind(const std::string& scene, int64_t number, int kind) {
  return database_->Read<bool>([&](soci::session& sql) -> absl::StatusOr<bool> {
    int found = 0;
    sql << "SELECT 1 FROM dataset_files WHERE scene = :scene AND dataset = :dataset"
           " AND kind = :kind LIMIT 1",
        soci::use(scene), soci::use(number), soci::use(kind), soci::into(found);
    return sql.got_data();
  });
}

absl::StatusOr<std::vector<DatasetFileRow>> Store::ListDatasetFilesFrom(const std::string& scene,
                                                                        int64_t number,
                                                                        const std::string& path,
                                                                        int64_t limit) {
  using Files = std::vector<DatasetFileRow>;
  return database_->Read<Files>([&](soci::session& sql) -> absl::StatusOr<Files> {
    return SelectFiles(sql, {scene, number, "path >=", path, limit});
  });
}

absl::Status Store::MarkFilesStored(const UploadName& upload,
                                    const std::vector<DatasetFileRow>& files) {
  absl::Status refused;
  RETURN_IF_ERROR(database_->Transact([&](soci::session& sql) -> absl::Status {
    InsertBlobs(sql, upload.project, files);
    const auto dataset = SelectDataset(sql, upload.scene, upload.number);
    refused = dataset.status();
    if (!refused.ok()) return absl::OkStatus();
    if (dataset->state == DatasetState::kSealed) {
      refused = absl::FailedPreconditionError(
          absl::StrCat(DatasetName(upload.scene, upload.number), " is sealed"));
      return absl::OkStatus();
    }
    refused = MarkStored(sql, *dataset, files);
    return absl::OkStatus();
  }));
  return refused;
}

absl::Status Store::SetDigestsStored(const std::string& project,
                                     const std::vector<std::string>& digests, bool stored) {
  if (digests.empty()) return absl::OkStatus();
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    const int value = stored ? 1 : 0;
    for (const std::string& digest : digests) {
      sql << "UPDATE dataset_files SET stored = :stored, header = 0 WHERE sha256 = :digest"
             " AND scene IN (SELECT id FROM scenes WHERE project = :project)",
          soci::use(value), soci::use(digest), soci::use(project);
      sql << "DELETE FROM blobs WHERE project = :project AND sha256 = :digest", soci::use(project),
          soci::use(digest);
      if (!stored) continue;
      sql << "INSERT INTO blobs (project, sha256, size) SELECT s.project, f.sha256, MAX(f.size)"
             " FROM dataset_files f JOIN scenes s ON s.id = f.scene"
             " WHERE s.project = :project AND f.sha256 = :digest GROUP BY s.project, f.sha256",
          soci::use(project), soci::use(digest);
    }
    return absl::OkStatus();
  });
}

absl::Status Store::SetFileHeaders(const std::string& scene, int64_t number,
                                   const std::vector<DatasetFileRow>& files) {
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    DatasetRow dataset;
    dataset.scene = scene;
    dataset.number = number;
    UpdateFiles(sql, kHeaderColumns, dataset, files);
    return absl::OkStatus();
  });
}

absl::StatusOr<DatasetRow> Store::SealDataset(const std::string& scene, int64_t number,
                                              const std::vector<DatasetFileRow>& found) {
  return database_->Query<DatasetRow>([&](soci::session& sql) -> absl::StatusOr<DatasetRow> {
    ASSIGN_OR_RETURN(const DatasetRow dataset, SelectDataset(sql, scene, number));
    if (dataset.state == DatasetState::kOpen) {
      InsertBlobs(sql, SelectProjectOf(sql, scene), found);
      RETURN_IF_ERROR(MarkStored(sql, dataset, found));
    }
    return Seal(sql, dataset);
  });
}

}  // namespace pepeseg
