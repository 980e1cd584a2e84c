#include "server/store/file_store.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/store_sql.h"

namespace pepeseg {
namespace {

// Sets columns of those files of a dataset that have the same path and digest as in `files`.
// `columns`: assignments from the values `v`, as "header = v.header". Returns the number of files
// found.
int64_t UpdateFiles(soci::session& sql, const std::string& columns, const DatasetRecord& dataset,
                    const std::vector<DatasetFileRecord>& files) {
  // The casts give PostgreSQL the types of the placeholders, which it cannot infer in a SELECT
  // without a table.
  BatchStatement update(
      sql, {"UPDATE dataset_files SET " + columns + " FROM (",
            "SELECT CAST(? AS BIGINT) AS scene, CAST(? AS BIGINT) AS dataset,"
            " CAST(? AS TEXT) AS path, CAST(? AS VARCHAR(64)) AS sha256,"
            " CAST(? AS INTEGER) AS header, CAST(? AS INTEGER) AS width,"
            " CAST(? AS INTEGER) AS height, CAST(? AS BIGINT) AS num_points",
            " UNION ALL ",
            ") AS v WHERE dataset_files.scene = v.scene AND dataset_files.dataset = v.dataset AND"
            " dataset_files.path = v.path AND dataset_files.sha256 = v.sha256"});
  for (const DatasetFileRecord& file : files) {
    update.Add({dataset.scene.id, dataset.number, file.path, file.sha256,
                static_cast<int64_t>(file.header), int64_t{file.width}, int64_t{file.height},
                file.num_points});
  }
  return update.Finish();
}

constexpr char kHeaderColumns[] =
    "header = v.header, width = v.width, height = v.height, num_points = v.num_points";

}  // namespace

std::vector<DatasetFileRecord> SelectFiles(soci::session& sql, const FileQuery& query) {
  DatasetFileRecord row;
  int stored = 0;
  int header = 0;
  soci::statement select =
      (sql.prepare << "SELECT path, kind, size, sha256, stored, header, width, height, num_points"
                      " FROM dataset_files WHERE scene = :scene AND dataset = :dataset AND "
                   << query.condition << " :key ORDER BY path LIMIT :limit",
       soci::into(row.path), soci::into(row.kind), soci::into(row.size), soci::into(row.sha256),
       soci::into(stored), soci::into(header), soci::into(row.width), soci::into(row.height),
       soci::into(row.num_points), soci::use(query.scene.id), soci::use(query.dataset),
       soci::use(query.key), soci::use(query.limit));
  select.execute();
  std::vector<DatasetFileRecord> rows;
  while (select.fetch()) {
    row.stored = stored != 0;
    row.header = static_cast<HeaderState>(header);
    rows.push_back(row);
  }
  return rows;
}

void InsertFiles(soci::session& sql, const DatasetRecord& dataset,
                 const std::vector<DatasetFileRecord>& files) {
  BatchStatement insert(
      sql, {"INSERT INTO dataset_files (scene, dataset, path, kind, size, sha256, stored) VALUES ",
            "(CAST(? AS BIGINT), CAST(? AS BIGINT), CAST(? AS TEXT), CAST(? AS INTEGER),"
            " CAST(? AS BIGINT), CAST(? AS VARCHAR(64)), CAST(? AS INTEGER))",
            ", ", ""});
  for (const DatasetFileRecord& file : files) {
    insert.Add({dataset.scene.id, dataset.number, file.path, int64_t{file.kind}, file.size,
                file.sha256, int64_t{file.stored ? 1 : 0}});
  }
  insert.Finish();
}

void InsertBlobs(soci::session& sql, const std::string& project,
                 const std::vector<DatasetFileRecord>& files) {
  // A digest counts once per project, however many files have it.
  BatchStatement insert(sql, {"INSERT INTO blobs (project, sha256, size) VALUES ",
                              "(CAST(? AS VARCHAR(63)), CAST(? AS VARCHAR(64)), CAST(? AS BIGINT))",
                              ", ", " ON CONFLICT (project, sha256) DO NOTHING"});
  for (const DatasetFileRecord& file : files) insert.Add({project, file.sha256, file.size});
  insert.Finish();
}

// The digest is part of the match, so a file with another digest counts as not found.
absl::Status MarkStored(soci::session& sql, const DatasetRecord& dataset,
                        const std::vector<DatasetFileRecord>& files) {
  const std::string columns = absl::StrCat("stored = 1, ", kHeaderColumns);
  const int64_t num_found = UpdateFiles(sql, columns, dataset, files);
  if (num_found == static_cast<int64_t>(files.size())) return absl::OkStatus();
  return absl::NotFoundError(absl::StrCat(ChildName(dataset.scene, "datasets", dataset.number),
                                          " has ", num_found, " of the ", files.size(),
                                          " files that were written"));
}

absl::StatusOr<std::vector<DatasetFileRecord>> FileStore::ListDatasetFiles(const SceneRef& scene,
                                                                           int64_t number) {
  using Files = std::vector<DatasetFileRecord>;
  return database_.Query<Files>([&](soci::session& sql) -> absl::StatusOr<Files> {
    ASSIGN_OR_RETURN(const DatasetRecord dataset, SelectDataset(sql, scene, number));
    FileQuery query;
    query.scene = dataset.scene;
    query.dataset = number;
    return SelectFiles(sql, query);
  });
}

absl::StatusOr<DatasetFileRecord> FileStore::GetDatasetFile(const SceneRef& scene, int64_t number,
                                                            const std::string& path) {
  return database_.Query<DatasetFileRecord>(
      [&](soci::session& sql) -> absl::StatusOr<DatasetFileRecord> {
        ASSIGN_OR_RETURN(const DatasetRecord dataset, SelectDataset(sql, scene, number));
        std::vector<DatasetFileRecord> rows =
            SelectFiles(sql, {dataset.scene, number, "path =", path, 1});
        if (rows.empty()) {
          return absl::NotFoundError(
              absl::StrCat(ChildName(scene, "datasets", number), " has no file '", path, "'"));
        }
        return rows[0];
      });
}

absl::StatusOr<bool> FileStore::HasFileOfKind(const SceneRef& scene, int64_t number, int kind) {
  return database_.Read<bool>([&](soci::session& sql) -> absl::StatusOr<bool> {
    int found = 0;
    sql << "SELECT 1 FROM dataset_files WHERE scene = :scene AND dataset = :dataset"
           " AND kind = :kind LIMIT 1",
        soci::use(scene.id), soci::use(number), soci::use(kind), soci::into(found);
    return sql.got_data();
  });
}

absl::StatusOr<std::vector<DatasetFileRecord>> FileStore::ListDatasetFilesFrom(
    const SceneRef& scene, int64_t number, const std::string& path, int64_t limit) {
  using Files = std::vector<DatasetFileRecord>;
  return database_.Read<Files>([&](soci::session& sql) -> absl::StatusOr<Files> {
    return SelectFiles(sql, {scene, number, "path >=", path, limit});
  });
}

absl::Status FileStore::MarkFilesStored(const UploadName& upload,
                                        const std::vector<DatasetFileRecord>& files) {
  // The transaction commits even if the files are refused: the blobs are on the disk and must
  // count. So the refusal is returned separately.
  absl::Status refused;
  RETURN_IF_ERROR(database_.Transact([&](soci::session& sql) -> absl::Status {
    InsertBlobs(sql, upload.scene.project, files);
    // NOT_FOUND: the upload was deleted while its files were written. The blobs then count until
    // the collector removes them.
    const auto dataset = SelectDataset(sql, upload.scene, upload.number);
    refused = dataset.status();
    if (!refused.ok()) return absl::OkStatus();
    if (dataset->state == DatasetState::kSealed) {
      refused = absl::FailedPreconditionError(
          absl::StrCat(ChildName(upload.scene, "datasets", upload.number), " is sealed"));
      return absl::OkStatus();
    }
    refused = MarkStored(sql, *dataset, files);
    return absl::OkStatus();
  }));
  return refused;
}

absl::Status FileStore::SetDigestsStored(const std::string& project,
                                         const std::vector<std::string>& digests, bool stored) {
  if (digests.empty()) return absl::OkStatus();
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    const int value = stored ? 1 : 0;
    for (const std::string& digest : digests) {
      // The header is unknown again: what was read of damaged bytes, or of none, does not count for
      // new ones.
      sql << "UPDATE dataset_files SET stored = :stored, header = 0 WHERE sha256 = :digest"
             " AND scene IN (SELECT id FROM scenes WHERE project = :project)",
          soci::use(value), soci::use(digest), soci::use(project);
      // Deleted and inserted, so that the size is that of the declarations.
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

absl::Status FileStore::SetFileHeaders(const SceneRef& scene, int64_t number,
                                       const std::vector<DatasetFileRecord>& files) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    DatasetRecord dataset;
    dataset.scene = scene;
    dataset.number = number;
    UpdateFiles(sql, kHeaderColumns, dataset, files);
    return absl::OkStatus();
  });
}

absl::StatusOr<std::set<std::string>> FileStore::ListDigests(const std::string& project) {
  using Digests = std::set<std::string>;
  return database_.Query<Digests>([&](soci::session& sql) -> absl::StatusOr<Digests> {
    std::string digest;
    soci::statement select =
        (sql.prepare << "SELECT DISTINCT f.sha256 FROM dataset_files f"
                        " JOIN scenes s ON s.id = f.scene WHERE s.project = :project",
         soci::into(digest), soci::use(project));
    select.execute();
    Digests digests;
    while (select.fetch()) digests.insert(digest);
    return digests;
  });
}

absl::StatusOr<std::set<std::string>> FileStore::ListBlobs(const std::string& project) {
  using Digests = std::set<std::string>;
  return database_.Query<Digests>([&](soci::session& sql) -> absl::StatusOr<Digests> {
    std::string digest;
    soci::statement select = (sql.prepare << "SELECT sha256 FROM blobs WHERE project = :project",
                              soci::into(digest), soci::use(project));
    select.execute();
    Digests digests;
    while (select.fetch()) digests.insert(digest);
    return digests;
  });
}

absl::StatusOr<std::vector<std::string>> FileStore::ListBlobProjects() {
  using Projects = std::vector<std::string>;
  return database_.Query<Projects>([&](soci::session& sql) -> absl::StatusOr<Projects> {
    std::string project;
    soci::statement select =
        (sql.prepare << "SELECT DISTINCT project FROM blobs ORDER BY project", soci::into(project));
    select.execute();
    Projects projects;
    while (select.fetch()) projects.push_back(project);
    return projects;
  });
}

absl::Status FileStore::ForgetBlobs(const std::string& project,
                                    const std::vector<std::string>& digests) {
  return database_.Transact([&](soci::session& sql) -> absl::Status {
    BatchStatement remove(sql,
                          {"DELETE FROM blobs WHERE ", "(project = ? AND sha256 = ?)", " OR ", ""});
    for (const std::string& digest : digests) remove.Add({project, digest});
    remove.Finish();
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
