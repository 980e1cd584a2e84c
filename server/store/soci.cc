#include "server/store/soci.h"

#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/module.h"
#include "core/base/status_macros.h"
#include "server/store/postgresql_module.h"

namespace pepeseg {
namespace {

// Null until the module is loaded: before that no error is PostgreSQL's.
std::atomic<const PostgresqlModule*> postgresql = nullptr;

std::string SqlState(const soci::soci_error& error) {
  const PostgresqlModule* module = postgresql;
  return module == nullptr ? "" : module->sql_state(error);
}

bool IsBrokenConstraint(const soci::soci_error& error) {
  if (error.get_error_category() == soci::soci_error::constraint_violation) return true;
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  // The low byte is the primary code of an extended one.
  return sqlite != nullptr && (sqlite->result() & 0xff) == SQLITE_CONSTRAINT;
}

bool IsFullDisk(const soci::soci_error& error, int system_error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  // PostgreSQL: disk_full.
  if (sqlite == nullptr) return SqlState(error) == "53100";
  const int code = sqlite->result() & 0xff;
  return code == SQLITE_FULL ||
         (code == SQLITE_IOERR && (system_error == ENOSPC || system_error == EDQUOT));
}

// SQLite: "malformed" or "not a database". PostgreSQL: data_corrupted or index_corrupted.
bool IsDamage(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  const int code = sqlite == nullptr ? SQLITE_OK : sqlite->result() & 0xff;
  const std::string state = SqlState(error);
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB || state == "XX001" || state == "XX002";
}

// PostgreSQL: class 08, or the connection was ended by an administrator or a crash, or the server
// is starting.
bool IsLostConnection(const soci::soci_error& error) {
  const std::string state = SqlState(error);
  return error.get_error_category() == soci::soci_error::connection_error ||
         state.starts_with("08") || state == "57P01" || state == "57P02" || state == "57P03";
}

absl::StatusCode CodeOf(const soci::soci_error& error, int system_error) {
  // A constraint that holds is checked before each insertion, so a broken one means that another
  // call came first: a retry sees its record.
  if (IsBrokenConstraint(error)) return absl::StatusCode::kAborted;
  if (IsFullDisk(error, system_error)) return absl::StatusCode::kResourceExhausted;
  if (IsDamage(error)) return absl::StatusCode::kDataLoss;
  if (IsLostConnection(error) || IsCollision(error)) return absl::StatusCode::kUnavailable;
  return absl::StatusCode::kInternal;
}

}  // namespace

absl::StatusOr<const soci::backend_factory*> PostgresqlBackend() {
  ASSIGN_OR_RETURN(void* const get, LoadModule("postgresql", kGetPostgresql));
  postgresql = reinterpret_cast<GetPostgresqlFn*>(get)();
  return postgresql.load()->factory;
}

bool IsCollision(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  if (sqlite != nullptr) return (sqlite->result() & 0xff) == SQLITE_BUSY;
  const std::string state = SqlState(error);
  // PostgreSQL: serialization_failure, deadlock_detected and unique_violation. The last is a
  // collision, too: when the transaction runs again, it finds the record that the other one has
  // inserted.
  return state == "40001" || state == "40P01" || state == "23505";
}

int SystemErrorOf(soci::session& sql) {
  // A session without a connection has no backend.
  if (!sql.is_connected() || sql.get_backend_name() != "sqlite3") return 0;
  using sqlite_api::sqlite3_file;
  auto* connection = static_cast<soci::sqlite3_session_backend*>(sql.get_backend())->conn_;
  if (connection == nullptr) return 0;
  // sqlite3_system_errno does not have the errors of a sync during a commit; the files do.
  for (const int which : {SQLITE_FCNTL_FILE_POINTER, SQLITE_FCNTL_JOURNAL_POINTER}) {
    sqlite3_file* file = nullptr;
    int error = 0;
    if (sqlite_api::sqlite3_file_control(connection, nullptr, which, &file) != SQLITE_OK) continue;
    if (file == nullptr || file->pMethods == nullptr) continue;
    if (file->pMethods->xFileControl(file, SQLITE_FCNTL_LAST_ERRNO, &error) != SQLITE_OK) continue;
    if (error != 0) return error;
  }
  return sqlite_api::sqlite3_system_errno(connection);
}

absl::Status DatabaseError(const soci::soci_error& error, int system_error) {
  std::string message = absl::StrCat("database: ", error.what());
  if (system_error != 0) {
    absl::StrAppend(&message, " (", std::generic_category().message(system_error), ")");
  }
  // Private: the text may have SQL, values and paths, which are for the log only.
  return PrivateError(CodeOf(error, system_error), message);
}

}  // namespace pepeseg
