#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/soci.h"

namespace pepeseg {

// The one place where SOCI's sessions and exceptions are handled. Thread safe: a caller takes a
// connection of the pool for the length of its transaction (SQLite: there is one, so that writers
// queue here and never meet "database is locked").
class Database {
 public:
  // "sqlite:PATH", or "postgresql:" and what libpq takes: "host=db dbname=pepeseg", or the rest of
  // a "postgresql://" URI. Brings the schema up to this program's version. UNAVAILABLE: no
  // connection. DATA_LOSS: SQLite's file is damaged, as far as its own checks see.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& url);

  // Runs `body` in a transaction that is as if no other ran beside it: commits when it answers OK,
  // rolls back otherwise. Where PostgreSQL finds that two got in each other's way, or a connection
  // is gone, it runs again: so `body` changes nothing but the database and its answer. A broken
  // constraint is ABORTED; DATA_LOSS: the database's files are damaged; UNAVAILABLE: it cannot be
  // reached, or too many others change the same; when a connection broke during the commit, nobody
  // knows whether it happened. Any other error is INTERNAL.
  absl::Status Transact(const std::function<absl::Status(soci::session&)>& body);

  // Likewise, for a body that answers a value.
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

  // For a body that is one SELECT in the usual case, and may be several of different moments: runs
  // it without a transaction's own round trips to the database.
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

  // Other processes may use it at the same time.
  bool shared() const { return backend_ == &soci::postgresql; }

 private:
  // What became of one run of a body.
  enum class Fate { kDone, kCollided, kConnectionLost };
  struct Run {
    Fate fate = Fate::kDone;
    absl::Status status;
  };

  Database(const soci::backend_factory& backend, std::string connection, size_t num_connections)
      : backend_(&backend), connection_(std::move(connection)), pool_(num_connections) {}
  absl::Status Connect(size_t num_connections);
  absl::Status Upgrade();
  absl::Status Repeat(const std::function<absl::Status(soci::session&)>& body, bool in_transaction);
  Run RunOnce(const std::function<absl::Status(soci::session&)>& body, bool in_transaction);

  const soci::backend_factory* const backend_;
  const std::string connection_;
  soci::connection_pool pool_;
};

// Microseconds since 1970 by the clock of the database, which is one for all servers on it.
int64_t DatabaseMicros(soci::session& sql);

}  // namespace pepeseg
