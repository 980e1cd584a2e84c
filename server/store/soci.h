#pragma once

// SOCI without its Boost extras. Debian's soci-config.h requires Boost's headers, which libsoci-dev
// does not depend on. They only add overloads of into() and use(), so leaving them out keeps the
// library's ABI. Include this file, never soci/*.h.
#define SOCICONFIG_H_INCLUDED
#define SOCI_HAVE_CXX11
#define SOCI_HAVE_VISIBILITY_SUPPORT

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// The meaning of SOCI's exceptions, for SQLite and PostgreSQL.
namespace pepeseg {

// Returns SOCI's part for PostgreSQL, which it loads first. FAILED_PRECONDITION: it is not
// installed.
absl::StatusOr<const soci::backend_factory*> PostgresqlBackend();

// Returns whether two transactions got in each other's way, so that this one should run again. In
// PostgreSQL this includes a key that is taken: another transaction may have taken it meanwhile,
// and the next run sees that.
bool IsCollision(const soci::soci_error& error);

// Returns the errno behind the newest I/O error of SQLite; 0 if there was none, and for PostgreSQL.
int SystemErrorOf(soci::session& sql);

// Returns the status for an exception, as a PrivateError. ABORTED: a broken constraint;
// RESOURCE_EXHAUSTED: a full disk; DATA_LOSS: damaged files; UNAVAILABLE: a lost connection or a
// collision; else INTERNAL. `system_error`: SystemErrorOf the session; it is needed because SQLite
// reports a full disk that only a sync finds as an I/O error.
absl::Status DatabaseError(const soci::soci_error& error, int system_error = 0);

}  // namespace pepeseg
