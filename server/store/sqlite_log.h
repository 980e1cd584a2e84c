#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace pepeseg {

// Checks the write-ahead log that a killed server left next to a SQLite database. Call it before
// SQLite opens the database: SQLite takes a damaged frame for the end of the log and silently drops
// all commits after it.
//
// DATA_LOSS: a frame is damaged and at least two commits come from there on, so that at least one
// of them had been synced; names the byte. An incomplete last commit is not damage: it is what a
// power cut leaves of a commit that was never confirmed. Other processes may use the database
// meanwhile.
absl::Status CheckSqliteLog(const std::filesystem::path& database);

}  // namespace pepeseg
