#pragma once

#include <vector>

namespace pepeseg {

// The schema is built in steps, which are never edited once released. They are SQL that both SQLite
// and PostgreSQL accept. Times are microseconds since 1970 UTC, 0: not yet. Serialised messages are
// stored as base64.
inline constexpr int kSchemaVersion = 9;

// Returns the statements that lead from version `to - 1` to `to`, in [1, kSchemaVersion].
std::vector<const char*> SchemaStep(int to);
// Returns further statements for PostgreSQL, to run after SchemaStep's: they widen columns, whose
// lengths SQLite does not limit.
std::vector<const char*> PostgresqlSchemaStep(int to);

}  // namespace pepeseg
