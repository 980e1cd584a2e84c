#include "server/store/database.h"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/store/schema.h"
#include "server/store/sqlite_log.h"

namespace pepeseg {
namespace {

// PostgreSQL connections, and so the calls that can use the database at the same time.
constexpr size_t kNumConnections = 8;
// Time after which colliding transactions are not run again. They wait up to 2, 4, 8 ... 32 ms
// between runs.
constexpr absl::Duration kMaxCollisions = absl::Seconds(10);

// Turns exceptions into a status. All SOCI calls of this program run below Guard or RunOnce.
absl::Status Guard(const std::function<absl::Status()>& body) {
  try {
    return body();
  } catch (const soci::soci_error& error) {
    return DatabaseError(error);
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("database: ", error.what()));
  }
}

// Sets the options of a new connection.
void SetUp(soci::session& sql) {
  if (sql.get_backend_name() == "postgresql") {
    sql << "SET default_transaction_isolation = 'serializable'";
    // A call that hangs must not block its thread, or lock records, for ever.
    sql << "SET statement_timeout = '20s'";
    sql << "SET idle_in_transaction_session_timeout = '60s'";
    sql << "SET client_min_messages = 'warning'";
    return;
  }
  std::string mode;
  // With a write-ahead log readers do not wait for the writer.
  sql << "PRAGMA journal_mode = WAL", soci::into(mode);
  // A change that was confirmed to a client must survive a power cut.
  sql << "PRAGMA synchronous = FULL";
  // Off by default in SQLite, and a setting of the connection: the cascades of deletions need it.
  sql << "PRAGMA foreign_keys = ON";
}

// Returns DATA_LOSS if SQLite's checks find damage, before anything is read from the file: its
// pages and foreign keys must be consistent and, if the file is small enough for that to be fast,
// its indexes and records. A bit flip inside a stored value is not detected.
absl::Status CheckSqliteFile(soci::session& sql) {
  constexpr int kMostPages = 2048;  // of 4 KiB: the full check takes a third of a second
  // Also in the pragma's text below.
  constexpr int kMostFaults = 3;
  int num_pages = 0;
  sql << "PRAGMA page_count", soci::into(num_pages);
  std::vector<std::string> faults(kMostFaults);
  sql << (num_pages > kMostPages ? "PRAGMA quick_check(3)" : "PRAGMA integrity_check(3)"),
      soci::into(faults);
  if (!faults.empty() && faults[0] != "ok") {
    return absl::DataLossError(absl::StrCat("damaged: ", absl::StrJoin(faults, "; ")));
  }
  std::string table;
  sql << "SELECT \"table\" FROM pragma_foreign_key_check LIMIT 1", soci::into(table);
  if (!sql.got_data()) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat("damaged: a record of ", table, " refers to a record that does not exist"));
}

// Returns FAILED_PRECONDITION, with what to do, unless this program can use a schema of `version`.
absl::Status CheckVersion(int version) {
  if (version == kSchemaVersion) return absl::OkStatus();
  const absl::string_view remedy =
      version > kSchemaVersion
          ? "a newer pepesegd has written it: install that one, or restore a backup that this one "
            "can read"
          : "a pepesegd from before the first release has written it, and there is no migration: "
            "start with a new data directory and an empty database, and train the scenes again";
  return absl::FailedPreconditionError(absl::StrCat("the database has schema version ", version,
                                                    ", and this program needs version ",
                                                    kSchemaVersion, "; ", remedy));
}

// A transaction that rolls back unless committed. In SQLite it takes the write lock at once
// (IMMEDIATE): one that asks for the lock later is refused if another process has written
// meanwhile.
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
      // The connection is lost, which also rolls back.
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

// Leases a connection of the pool. soci::session(pool) cannot be used: it is left with a dangling
// pointer when a reconnection fails.
class Connection {
 public:
  explicit Connection(soci::connection_pool& pool)
      : pool_(pool), leased_(pool.try_lease(position_, kLeaseMilliseconds)) {}
  ~Connection() {
    if (leased_) pool_.give_back(position_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool leased() const { return leased_; }
  soci::session& sql() const { return pool_.at(position_); }

 private:
  static constexpr int kLeaseMilliseconds = 30'000;
  soci::connection_pool& pool_;
  size_t position_ = 0;
  const bool leased_;
};

// Returns a random pause before the next run of a transaction that has collided `run` times.
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
    // Before SQLite opens the file: it would cut a damaged log off silently, and its commits would
    // be lost.
    RETURN_IF_ERROR(CheckSqliteLog(url.substr(kSqlite.size())));
    database.reset(new Database(
        soci::sqlite3, absl::StrCat("dbname=\"", url.substr(kSqlite.size()), "\" timeout=10"), 1));
  } else if (url.starts_with(kPostgresql) && url.size() > kPostgresql.size()) {
    ASSIGN_OR_RETURN(const soci::backend_factory* const backend, PostgresqlBackend());
    const bool is_uri = url.starts_with("postgresql://");
    num_connections = kNumConnections;
    // A call must not wait for minutes for a host that does not answer. The operator's own value
    // counts.
    setenv("PGCONNECT_TIMEOUT", "5", /*overwrite=*/0);
    database.reset(
        new Database(*backend, is_uri ? url : url.substr(kPostgresql.size()), num_connections));
  } else {
    // The message does not contain the URL, which may hold a password.
    return absl::InvalidArgumentError(
        "database: expected sqlite:PATH without quotes, or postgresql:CONNINFO");
  }
  absl::Status opened = database->Connect(num_connections);
  if (opened.ok()) opened = database->Prepare();
  if (opened.ok()) return database;
  if (!absl::IsDataLoss(opened)) return opened;
  const std::string name = database->shared() ? "the PostgreSQL database" : url;
  return absl::DataLossError(absl::StrCat(
      name, ": ", opened.message(),
      "; restore it from a backup, or rescue what is left with the database's own tools"));
}

// Opens the connections one by one. They are never closed: RunOnce reconnects one that was lost.
absl::Status Database::Connect(size_t num_connections) {
  return Guard([&]() -> absl::Status {
    for (size_t i = 0; i < num_connections; ++i) {
      soci::session& sql = pool_.at(i);
      sql.open(*backend_, connection_);
      SetUp(sql);
    }
    return shared() ? absl::OkStatus() : CheckSqliteFile(pool_.at(0));
  });
}

// Runs a body on one connection, which this thread has alone meanwhile. Waits up to 30 s for a free
// connection. Throws nothing.
Database::Run Database::RunOnce(const std::function<absl::Status(soci::session&)>& body,
                                bool in_transaction) {
  Run run;
  bool committing = false;
  const Connection connection(pool_);
  if (!connection.leased()) {
    run.status = PrivateError(absl::StatusCode::kUnavailable, "database: all connections are busy");
    return run;
  }
  soci::session& sql = connection.sql();
  try {
    if (!sql.is_connected()) {
      // The connection was lost by an earlier call. Its settings are gone with it.
      sql.reconnect();
      SetUp(sql);
    }
    std::optional<Transaction> transaction;  // rolls back unless committed
    if (in_transaction) transaction.emplace(sql);
    run.status = body(sql);
    // An error of the body rolls back.
    if (!run.status.ok() || !in_transaction) return run;
    // From here on a failure leaves open whether the transaction took place.
    committing = true;
    transaction->Commit();
  } catch (const soci::soci_error& error) {
    run.status = DatabaseError(error, SystemErrorOf(sql));
    if (IsCollision(error)) run.fate = Fate::kCollided;
    // A commit whose connection broke may have succeeded, so it must not run again.
    if (!committing && !sql.is_connected()) run.fate = Fate::kConnectionLost;
    if (!sql.is_connected()) {
      run.status = PrivateError(absl::StatusCode::kUnavailable, run.status.message());
    }
  } catch (const std::exception& error) {
    run.status = absl::InternalError(absl::StrCat("database: ", error.what()));
  }
  return run;
}

absl::Status Database::Transact(const std::function<absl::Status(soci::session&)>& body) {
  return Repeat(body, /*in_transaction=*/true);
}

// Serializable transactions of PostgreSQL may fail at any statement, or at the commit, because of
// another one; SQLite reports a busy file if another process writes. Both are run again from the
// start after a random pause, which grows so that many colliding servers spread out.
absl::Status Database::Repeat(const std::function<absl::Status(soci::session&)>& body,
                              bool in_transaction) {
  bool reconnected = false;
  const absl::Time deadline = absl::Now() + kMaxCollisions;
  for (int count = 1;; ++count) {
    Run run = RunOnce(body, in_transaction);
    // A lost connection is tried again once: a server that has restarted is found at the second
    // attempt, and one that is gone must not delay the call.
    const bool again = run.fate == Fate::kCollided ||
                       (run.fate == Fate::kConnectionLost && !std::exchange(reconnected, true));
    if (!again || absl::Now() > deadline) return run.status;
    absl::SleepFor(Backoff(count));
  }
}

// Creates the schema in an empty database, or checks the version of the one that is there. All in
// one transaction, so that a start that fails leaves an empty database.
absl::Status Database::Prepare() {
  return Transact([this](soci::session& sql) {
    // One server creates the schema, and those that start at the same time wait for it. In SQLite
    // the transaction has the write lock.
    constexpr int64_t kSchemaLock = 0x706570657365;
    if (shared()) {
      // Serializable would take its snapshot before the lock, and not see another server's schema.
      sql << "SET TRANSACTION ISOLATION LEVEL READ COMMITTED";
      sql << "SELECT pg_advisory_xact_lock(:key)", soci::use(kSchemaLock);
    }
    sql << "CREATE TABLE IF NOT EXISTS schema_version (version INTEGER NOT NULL)";
    int version = 0;
    sql << "SELECT COALESCE(MAX(version), 0) FROM schema_version", soci::into(version);
    if (version != 0) return CheckVersion(version);
    for (const std::string& statement : SchemaStatements()) sql << statement;
    sql << "INSERT INTO schema_version (version) VALUES (:v)", soci::use(kSchemaVersion);
    return absl::OkStatus();
  });
}

}  // namespace pepeseg
