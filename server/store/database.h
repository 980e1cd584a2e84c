#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/soci.h"

namespace pepeseg {

// A SQLite or PostgreSQL database. The only class that opens SOCI's sessions and catches its
// exceptions. Thread safe: a caller takes a connection from the pool for the length of its
// transaction. SQLite has one connection, so that writers queue here and never get "database is
// locked".
class Database {
 public:
  // `url`: "sqlite:PATH", or "postgresql:" followed by libpq's "host=db dbname=pepeseg" or by the
  // rest of a "postgresql://" URI. Creates the schema in an empty database. UNAVAILABLE: no
  // connection. DATA_LOSS: SQLite's own checks find the file damaged. FAILED_PRECONDITION: the
  // schema has another version than kSchemaVersion, or PostgreSQL's module is not installed.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& url);

  // Runs `body` in a serializable transaction; commits if it returns OK, else rolls back. Runs it
  // again, for up to ten seconds, if transactions collide, and once if the connection is lost
  // before the commit. So `body` must change nothing but the database and its result.
  //
  // Returns the error of `body`, or ABORTED: a broken constraint; DATA_LOSS: the database's files
  // are damaged; RESOURCE_EXHAUSTED: its disk is full; UNAVAILABLE: it cannot be reached, or
  // collisions did not end; if the connection broke during the commit, the transaction may have
  // been committed. Any other error is INTERNAL.
  absl::Status Transact(const std::function<absl::Status(soci::session&)>& body);

  // Does the same for a body that returns a value.
  template <typename T>
  absl::StatusOr<T> Query(const std::function<absl::StatusOr<T>(soci::session&)>& body) {
    absl::StatusOr<T> answer = absl::InternalError("the transaction did not run");
    absl::Status status = Transact([&](soci::session& sql) {
      answer = body(sql);
      return answer.status();
    });
    if (!status.ok()) return status;
    return answer;
  }

  // Runs a read-only body without a transaction, which saves the round trips of BEGIN and COMMIT.
  // For a body that is usually one SELECT; several see the database at different moments. Errors as
  // for Transact.
  template <typename T>
  absl::StatusOr<T> Read(const std::function<absl::StatusOr<T>(soci::session&)>& body) {
    absl::StatusOr<T> answer = absl::InternalError("the query did not run");
    absl::Status status = Repeat(
        [&](soci::session& sql) {
          answer = body(sql);
          return answer.status();
        },
        /*in_transaction=*/false);
    if (!status.ok()) return status;
    return answer;
  }

  // Returns whether other servers may use the database at the same time.
  bool shared() const { return backend_ != &soci::sqlite3; }

 private:
  // How one run of a body ended.
  enum class Fate { kDone, kCollided, kConnectionLost };
  struct Run {
    Fate fate = Fate::kDone;
    absl::Status status;
  };

  Database(const soci::backend_factory& backend, std::string connection, size_t num_connections)
      : backend_(&backend), connection_(std::move(connection)), pool_(num_connections) {}
  absl::Status Connect(size_t num_connections);
  absl::Status Prepare();
  absl::Status Repeat(const std::function<absl::Status(soci::session&)>& body, bool in_transaction);
  Run RunOnce(const std::function<absl::Status(soci::session&)>& body, bool in_transaction);

  const soci::backend_factory* const backend_;
  const std::string connection_;
  soci::connection_pool pool_;
};

// Returns microseconds since 1970 by the clock that all servers of this database share.
int64_t DatabaseMicros(soci::session& sql);

}  // namespace pepeseg
