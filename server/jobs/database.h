#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/soci.h"

namespace pepeseg {

// The one place where SOCI's sessions and exceptions are handled. Thread safe: a caller takes a
// connection of the pool for the length of its transaction (SQLite: there is one, so that writers
// queue here and never meet "database is locked").
class Database {
 public:
  // "sqlite:PATH"; brings the schema up to this program's version.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& url);

  // Runs `body` in a write transaction: commits when it answers OK, rolls back otherwise. A broken
  // constraint is ABORTED, any other database error INTERNAL.
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

 private:
  explicit Database(size_t num_connections) : pool_(num_connections) {}
  absl::Status Connect(const std::string& path);
  absl::Status Upgrade();

  soci::connection_pool pool_;
};

}  // namespace pepeseg
