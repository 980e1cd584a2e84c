#pragma once

#include <vector>

namespace pepeseg {

// The schema grows by steps that are never edited once released; SQL that SQLite and PostgreSQL
// both take. Times are microseconds since 1970 UTC, 0: not yet. Serialised messages are base64.
inline constexpr int kSchemaVersion = 8;

// The statements that lead from version `to - 1` to `to`, in [1, kSchemaVersion].
std::vector<const char*> SchemaStep(int to);
// Further ones for PostgreSQL, after these. (SQLite does not limit the length of texts.)
std::vector<const char*> PostgresqlSchemaStep(int to);

}  // namespace pepeseg
