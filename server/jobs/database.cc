#include "server/jobs/database.h"

#include <exception>
#include <string>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/schema.h"

namespace pepeseg {
namespace {

bool IsBrokenConstraint(const soci::soci_error& error) {
  if (error.get_error_category() == soci::soci_error::constraint_violation) return true;
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  // The low byte is the primary code of an extended one.
  return sqlite != nullptr && (sqlite->result() & 0xff) == SQLITE_CONSTRAINT;
}

// Every SOCI call of this program runs below here.
absl::Status Guard(const std::function<absl::Status()>& body) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    if (IsBrokenConstraint(error)) return absl::AbortedError(error.get_error_message());
    return absl::InternalError(absl::StrCat("database: ", error.what()));
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("database: ", error.what()));
  }
}

}  // namespace

absl::StatusOr<std::unique_ptr<Database>> Database::Open(const std::string& url) {
  constexpr std::string_view kScheme = "sqlite:";
  if (!url.starts_with(kScheme) || url.size() == kScheme.size() ||
      url.find('"') != std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("database '", url, "': expected sqlite:PATH without quotes"));
  }
  auto database = std::unique_ptr<Database>(new Database(1));
  RETURN_IF_ERROR(database->Connect(url.substr(kScheme.size())));
  RETURN_IF_ERROR(database->Upgrade());
  return database;
}

absl::Status Database::Connect(const std::string& path) {
  return Guard([&] {
    soci::session& sql = pool_.at(0);
    sql.open(soci::sqlite3, absl::StrCat("dbname=\"", path, "\" timeout=10"));
    std::string mode;
    sql << "PRAGMA journal_mode = WAL", soci::into(mode);
    // A state change that was answered must survive a power cut.
    sql << "PRAGMA synchronous = FULL";
    sql << "PRAGMA foreign_keys = ON";
    return absl::OkStatus();
  });
}

absl::Status Database::Transact(const std::function<absl::Status(soci::session&)>& body) {
  return Guard([&] {
    soci::session sql(pool_);
    soci::transaction transaction(sql);  // rolls back unless committed
    RETURN_IF_ERROR(body(sql));
    transaction.commit();
    return absl::OkStatus();
  });
}

absl::Status Database::Upgrade() {
  return Transact([](soci::session& sql) {
    sql << "CREATE TABLE IF NOT EXISTS schema_version (version INTEGER NOT NULL)";
    int version = 0;
    sql << "SELECT COALESCE(MAX(version), 0) FROM schema_version", soci::into(version);
    if (version > kSchemaVersion) {
      return absl::FailedPreconditionError(
          absl::StrCat("the database has schema version ", version, ", this program knows up to ",
                       kSchemaVersion, ": it was written by a newer one"));
    }
    for (int next = version + 1; next <= kSchemaVersion; ++next) {
      for (const char* statement : SchemaStep(next)) sql << statement;
      sql << "INSERT INTO schema_version (version) VALUES (:v)", soci::use(next);
    }
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
