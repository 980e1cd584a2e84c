#include "server/store/store.h"

#include "core/base/status_macros.h"
#include "server/store/database.h"

namespace pepeseg {

Store::Store(std::unique_ptr<Database> database, Holder holder)
    : database_(std::move(database)),
      holder_(std::move(holder)),
      scenes_(*database_),
      datasets_(*database_, default_quota_),
      files_(*database_),
      jobs_(*database_, default_quota_),
      queue_(*database_, holder_, default_quota_),
      models_(*database_, default_quota_),
      labels_(*database_),
      selections_(*database_, default_quota_),
      keys_(*database_),
      quotas_(*database_) {}
Store::~Store() = default;

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& url, Holder holder) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(url));
  return std::unique_ptr<Store>(new Store(std::move(database), std::move(holder)));
}

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& url) {
  return Open(url, Holder());
}

bool Store::shared() const { return database_->shared(); }

// A transaction, so that SQLite takes the write lock: a database that can only be read fails.
absl::Status Store::Ping() {
  return database_->Transact([](soci::session& sql) {
    int version = 0;
    sql << "SELECT MAX(version) FROM schema_version", soci::into(version);
    return absl::OkStatus();
  });
}

absl::StatusOr<std::string> Store::Identity() {
  return database_->Read<std::string>([](soci::session& sql) -> absl::StatusOr<std::string> {
    std::string id;
    sql << "SELECT id FROM database_identity", soci::into(id);
    return id;
  });
}

absl::Status Store::SetIdentity(const std::string& id) {
  return database_->Transact([&](soci::session& sql) {
    int count = 0;
    sql << "SELECT COUNT(*) FROM database_identity", soci::into(count);
    if (count > 0) return absl::AbortedError("the database has an identity");
    sql << "INSERT INTO database_identity (id) VALUES (:id)", soci::use(id);
    return absl::OkStatus();
  });
}

absl::StatusOr<Store::Counts> Store::CountAll() {
  return database_->Query<Counts>([](soci::session& sql) -> absl::StatusOr<Counts> {
    Counts counts;
    int state = 0;
    int64_t number = 0;
    soci::statement select = (sql.prepare << "SELECT state, COUNT(*) FROM jobs GROUP BY state",
                              soci::into(state), soci::into(number));
    select.execute();
    while (select.fetch()) counts.jobs[static_cast<JobState>(state)] = number;
    sql << "SELECT COUNT(*) FROM scenes", soci::into(counts.num_scenes);
    sql << "SELECT COUNT(*) FROM models", soci::into(counts.num_models);
    return counts;
  });
}

}  // namespace pepeseg
