#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace pepeseg {

// Looks at the write-ahead log that a killed server left beside a SQLite database, before SQLite
// does: that takes a damaged record for the end of the log, and drops without a word what was
// committed after it. DATA_LOSS: a record is damaged, and commits come after it that SQLite had
// synced; names the byte. What a power cut tore belongs to the last commit alone, which nobody was
// told of, and is no damage. Others may use the database meanwhile.
absl::Status CheckSqliteLog(const std::filesystem::path& database);

}  // namespace pepeseg
