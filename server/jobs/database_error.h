#pragma once

#include "absl/status/status.h"
#include "server/jobs/soci.h"

// What SOCI's exceptions mean, for SQLite and PostgreSQL alike.
namespace pepeseg {

// Two transactions, of which only one can stand. A key that is taken may be one that the other made
// meanwhile: run again, this one sees it.
bool IsCollision(const soci::soci_error& error);

// ABORTED: a broken constraint; RESOURCE_EXHAUSTED: a full disk; DATA_LOSS: damaged files;
// UNAVAILABLE: a lost connection or a collision; else INTERNAL. All are PrivateError.
absl::Status DatabaseError(const soci::soci_error& error);

}  // namespace pepeseg
