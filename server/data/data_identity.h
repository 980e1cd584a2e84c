#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "server/store/store.h"

namespace pepeseg {

// Checks that a data directory belongs to the database: both hold the same random number, which the
// first server that opens them makes. A server with another directory would fail the jobs of the
// database and take its files for lost, and one with another database would remove the files as
// garbage. FAILED_PRECONDITION: they do not belong together. Servers that share both may call it at
// the same time.
absl::Status CheckIdentity(Store& store, const std::filesystem::path& data);

}  // namespace pepeseg
