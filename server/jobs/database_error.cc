#include "server/jobs/database_error.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "server/jobs/private_error.h"

namespace pepeseg {
namespace {

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

// What the database finds broken in its own files.
bool IsDamage(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  const int code = sqlite == nullptr ? SQLITE_OK : sqlite->result() & 0xff;
  const std::string state = SqlState(error);
  return code == SQLITE_CORRUPT || code == SQLITE_NOTADB || state == "XX001" || state == "XX002";
}

// Class 08; an administrator or a crash ended the connection, or the server is starting.
bool IsLostConnection(const soci::soci_error& error) {
  const std::string state = SqlState(error);
  return error.get_error_category() == soci::soci_error::connection_error ||
         state.starts_with("08") || state == "57P01" || state == "57P02" || state == "57P03";
}

absl::StatusCode CodeOf(const soci::soci_error& error) {
  if (IsBrokenConstraint(error)) return absl::StatusCode::kAborted;
  if (IsFullDisk(error)) return absl::StatusCode::kResourceExhausted;
  if (IsDamage(error)) return absl::StatusCode::kDataLoss;
  if (IsLostConnection(error) || IsCollision(error)) return absl::StatusCode::kUnavailable;
  return absl::StatusCode::kInternal;
}

}  // namespace

bool IsCollision(const soci::soci_error& error) {
  const auto* sqlite = dynamic_cast<const soci::sqlite3_soci_error*>(&error);
  if (sqlite != nullptr) return (sqlite->result() & 0xff) == SQLITE_BUSY;
  const std::string state = SqlState(error);
  return state == "40001" || state == "40P01" || state == "23505";
}

absl::Status DatabaseError(const soci::soci_error& error) {
  return PrivateError(CodeOf(error), absl::StrCat("database: ", error.what()));
}

}  // namespace pepeseg
