#pragma once

#include "absl/status/status.h"
#include "server/store/soci.h"

// What SOCI's exceptions mean, for SQLite and PostgreSQL alike.
namespace pepeseg {

// Two transactions, of which only one can stand. A key that is taken may be one that the other made
// meanwhile: run again, this one sees it.
bool IsCollision(const soci::soci_error& error);

// Returns the error of the operating system behind the newest input or output error of SQLite, as
// errno has it; 0 where there was none, and with PostgreSQL.
int SystemErrorOf(soci::session& sql);

// ABORTED: a broken constraint; RESOURCE_EXHAUSTED: a full disk; DATA_LOSS: damaged files;
// UNAVAILABLE: a lost connection or a collision; else INTERNAL. All are PrivateError.
// `system_error`: SystemErrorOf the session, as SQLite reports a full disk that only a sync finds
// as an input or output error.
absl::Status DatabaseError(const soci::soci_error& error, int system_error = 0);

}  // namespace pepeseg
