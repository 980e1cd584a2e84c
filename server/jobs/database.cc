#include "server/jobs/database.h"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <random>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status_macros.h"
#include "server/jobs/schema.h"

namespace pepeseg {
namespace {

// Of calls that wait on PostgreSQL at the same time.
constexpr size_t kNumConnections = 8;
// Transactions that collide wait up to 2, 4, 8 ... 32 ms in between, and give up in the end.
constexpr absl::Duration kMaxCollisions = absl::Seconds(10);

std::string SqlState(const soci::soci_error& error) {
  const auto* postgresql = dynamic_cast<const soci::postgresql_soci_error*>(&error);
  return postgresql == nullptr ? "" : postgresql->sqlstate();
}

bool IsBrokenConstraint(const soci::soci_error& error) {
  if (error.get_error_category() == soci::soci_error::constraint_violation) return true;
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  // The low byte is the primary code of an extended one.
  return sqlite != nullptr && (sqlite->result() & 0xff) == SQLITE_CONSTRAINT;
}

bool IsFullDisk(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  return SqlState(error) == "53100" ||
         (sqlite != nullptr && (sqlite->result() & 0xff) == SQLITE_FULL);
}

// Two transactions, of which only one can stand. A key that is taken may be one that the other made
// meanwhile: run again, this one sees it.
bool IsCollision(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  if (sqlite != nullptr) return (sqlite->result() & 0xff) == SQLITE_BUSY;
  const std::string state = SqlState(error);
  return state == "40001" || state == "40P01" || state == "23505";
}

// Class 08; an administrator or a crash ended the connection, or the server is starting.
bool IsLostConnection(const soci::soci_error& error) {
  const std::string state = SqlState(error);
  return error.get_error_category() == soci::soci_error::connection_error ||
         state.starts_with("08") || state == "57P01" || state == "57P02" || state == "57P03";
}

absl::Status ToStatus(const soci::soci_error& error) {
  if (IsBrokenConstraint(error)) return absl::AbortedError(error.get_error_message());
  const std::string text = absl::StrCat("database: ", error.what());
  if (IsFullDisk(error)) return absl::ResourceExhaustedError(text);
  if (IsLostConnection(error) || IsCollision(error)) return absl::UnavailableError(text);
  return absl::InternalError(text);
}

// Every SOCI call of this program runs below here, or in RunOnce.
absl::Status Guard(const std::function<absl::Status()>& body) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    return ToStatus(error);
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("database: ", error.what()));
  }
}

void SetUp(soci::session& sql) {
  if (sql.get_backend_name() == "postgresql") {
    sql << "SET default_transaction_isolation = 'serializable'";
    // A call that hangs must not hold its thread, or a row, for ever.
    sql << "SET statement_timeout = '20s'";
    sql << "SET idle_in_transaction_session_timeout = '60s'";
    sql << "SET client_min_messages = 'warning'";
    return;
  }
  std::string mode;
  sql << "PRAGMA journal_mode = WAL", soci::into(mode);
  // A state change that was answered must survive a power cut.
  sql << "PRAGMA synchronous = FULL";
  sql << "PRAGMA foreign_keys = ON";
}

// SQLite: with the right to write from the start. One that asks for it later is refused when another
// process has written meanwhile.
class Transaction {
 public:
  explicit Transaction(soci::session& sql) : sql_(sql) {
    sql_ << (sql.get_backend_name() == "postgresql" ? "BEGIN" : "BEGIN IMMEDIATE");
  }
  ~Transaction() {
    if (ended_) return;
    try {
      sql_ << "ROLLBACK";
    } catch (const std::exception&) {
      // The connection is gone, and the transaction with it.
    }
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  void Commit() {
    sql_ << "COMMIT";
    ended_ = true;
  }

 private:
  soci::session& sql_;
  bool ended_ = false;
};

absl::Duration Backoff(int run) {
  thread_local std::minstd_rand random{std::random_device{}()};
  const int longest = 1 << std::min(run, 5);
  return absl::Microseconds(std::uniform_int_distribution<int>(100, 1000 * longest)(random));
}

}  // namespace

int64_t DatabaseMicros(soci::session& sql) {
  if (sql.get_backend_name() != "postgresql") return absl::ToUnixMicros(absl::Now());
  int64_t micros = 0;
  sql << "SELECT CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000000 AS BIGINT)",
      soci::into(micros);
  return micros;
}

absl::StatusOr<std::unique_ptr<Database>> Database::Open(const std::string& url) {
  constexpr std::string_view kSqlite = "sqlite:";
  constexpr std::string_view kPostgresql = "postgresql:";
  std::unique_ptr<Database> database;
  size_t num_connections = 1;
  if (url.starts_with(kSqlite) && url.size() > kSqlite.size() &&
      url.find('"') == std::string::npos) {
    database.reset(new Database(
        soci::sqlite3, absl::StrCat("dbname=\"", url.substr(kSqlite.size()), "\" timeout=10"), 1));
  } else if (url.starts_with(kPostgresql) && url.size() > kPostgresql.size()) {
    const bool is_uri = url.starts_with("postgresql://");
    num_connections = kNumConnections;
    setenv("PGCONNECT_TIMEOUT", "5", /*overwrite=*/0);
    database.reset(new Database(soci::postgresql, is_uri ? url : url.substr(kPostgresql.size()),
                                num_connections));
  } else {
    // Not told: it may hold a password.
    return absl::InvalidArgumentError(
        "database: expected sqlite:PATH without quotes, or postgresql:CONNINFO");
  }
  RETURN_IF_ERROR(database->Connect(num_connections));
  RETURN_IF_ERROR(database->Upgrade());
  return database;
}

absl::Status Database::Connect(size_t num_connections) {
  return Guard([&] {
    for (size_t i = 0; i < num_connections; ++i) {
      soci::session& sql = pool_.at(i);
      sql.open(*backend_, connection_);
      SetUp(sql);
    }
    return absl::OkStatus();
  });
}

Database::Run Database::RunOnce(const std::function<absl::Status(soci::session&)>& body) {
  Run run;
  bool committing = false;
  soci::session sql(pool_);
  try {
    if (!sql.is_connected()) {
      sql.reconnect();
      SetUp(sql);
    }
    Transaction transaction(sql);  // rolls back unless committed
    run.status = body(sql);
    if (!run.status.ok()) return run;
    committing = true;
    transaction.Commit();
  } catch (const soci::soci_error& error) {
    run.status = ToStatus(error);
    if (IsCollision(error)) run.fate = Fate::kCollided;
    // What broke during the commit may have happened: not to be done twice.
    if (!committing && !sql.is_connected()) run.fate = Fate::kConnectionLost;
    if (!sql.is_connected()) run.status = absl::UnavailableError(run.status.message());
  } catch (const std::exception& error) {
    run.status = absl::InternalError(absl::StrCat("database: ", error.what()));
  }
  return run;
}

absl::Status Database::Transact(const std::function<absl::Status(soci::session&)>& body) {
  bool reconnected = false;
  const absl::Time deadline = absl::Now() + kMaxCollisions;
  for (int count = 1;; ++count) {
    Run run = RunOnce(body);
    const bool again = run.fate == Fate::kCollided ||
                       (run.fate == Fate::kConnectionLost && !std::exchange(reconnected, true));
    if (!again || absl::Now() > deadline) return run.status;
    absl::SleepFor(Backoff(count));
  }
}

absl::Status Database::Upgrade() {
  return Transact([this](soci::session& sql) {
    // One server at a time; SQLite has one user anyway.
    constexpr int64_t kUpgradeLock = 0x706570657365;
    if (shared()) {
      sql << "SET TRANSACTION ISOLATION LEVEL READ COMMITTED";  // see what the one before has done
      sql << "SELECT pg_advisory_xact_lock(:key)", soci::use(kUpgradeLock);
    }
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
