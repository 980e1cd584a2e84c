#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg::client {

// NOT_FOUND names the file.
absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path);

// Makes the folder too; written beside and renamed, so that nobody reads half of it.
absl::Status WriteFile(const std::filesystem::path& path, absl::string_view bytes);

}  // namespace pepeseg::client
