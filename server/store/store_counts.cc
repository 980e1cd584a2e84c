// What the store tells of itself, for those who watch it.
#include "core/base/status_macros.h"
#include "server/store/database.h"
#include "server/store/store.h"

namespace pepeseg {

absl::Status Store::Ping() {
  return database_->Transact([](soci::session& sql) {
    int version = 0;
    sql << "SELECT MAX(version) FROM schema_version", soci::into(version);
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
