// What the store tells of what nothing refers to any more, and of what a project takes.
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/store/batch_statement.h"
#include "server/store/database.h"
#include "server/store/quota_sql.h"
#include "server/store/store.h"
#include "server/store/store_sql.h"

namespace pepeseg {

absl::StatusOr<std::vector<DatasetRow>> Store::ListOpenUploads(absl::Time created_before) {
  using Rows = std::vector<DatasetRow>;
  return database_->Query<Rows>([&](soci::session& sql) -> absl::StatusOr<Rows> {
    const int64_t before = ToMicros(created_before);
    DatasetRow row;
    int64_t create_time = 0;
    soci::statement select =
        (sql.prepare << "SELECT scene, number, create_time, num_files, num_bytes FROM datasets"
                        " WHERE state = 0 AND create_time < :before ORDER BY scene, number",
         soci::into(row.scene), soci::into(row.number), soci::into(create_time),
         soci::into(row.num_files), soci::into(row.num_bytes), soci::use(before));
    select.execute();
    Rows rows;
    while (select.fetch()) {
      row.create_time = FromMicros(create_time);
      rows.push_back(row);
    }
    return rows;
  });
}

absl::Status Store::DeleteUpload(const std::string& scene, int64_t number) {
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    ASSIGN_OR_RETURN(const DatasetRow dataset, SelectDataset(sql, scene, number));
    if (dataset.state == DatasetState::kSealed) {
      return absl::FailedPreconditionError(
          absl::StrCat("scenes/", scene, "/uploads/", number, " is sealed"));
    }
    sql << "DELETE FROM datasets WHERE scene = :scene AND number = :number",
        soci::use(dataset.scene), soci::use(number);  // its files cascade
    return absl::OkStatus();
  });
}

absl::StatusOr<std::set<std::string>> Store::ListDigests(const std::string& project) {
  using Digests = std::set<std::string>;
  return database_->Query<Digests>([&](soci::session& sql) -> absl::StatusOr<Digests> {
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

absl::StatusOr<std::set<std::string>> Store::ListBlobs(const std::string& project) {
  using Digests = std::set<std::string>;
  return database_->Query<Digests>([&](soci::session& sql) -> absl::StatusOr<Digests> {
    std::string digest;
    soci::statement select = (sql.prepare << "SELECT sha256 FROM blobs WHERE project = :project",
                              soci::into(digest), soci::use(project));
    select.execute();
    Digests digests;
    while (select.fetch()) digests.insert(digest);
    return digests;
  });
}

absl::StatusOr<std::vector<std::string>> Store::ListBlobProjects() {
  using Projects = std::vector<std::string>;
  return database_->Query<Projects>([&](soci::session& sql) -> absl::StatusOr<Projects> {
    std::string project;
    soci::statement select =
        (sql.prepare << "SELECT DISTINCT project FROM blobs ORDER BY project", soci::into(project));
    select.execute();
    Projects projects;
    while (select.fetch()) projects.push_back(project);
    return projects;
  });
}

absl::Status Store::ForgetBlobs(const std::string& project,
                                const std::vector<std::string>& digests) {
  return database_->Transact([&](soci::session& sql) -> absl::Status {
    BatchStatement remove(sql,
                          {"DELETE FROM blobs WHERE ", "(project = ? AND sha256 = ?)", " OR ", ""});
    for (const std::string& digest : digests) remove.Add({project, digest});
    remove.Finish();
    return absl::OkStatus();
  });
}

absl::StatusOr<Quota> Store::GetUsage(const std::string& project) {
  return database_->Query<Quota>(
      [&](soci::session& sql) -> absl::StatusOr<Quota> { return SelectUsage(sql, project); });
}

}  // namespace pepeseg
