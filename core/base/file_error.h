#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// "PATH: what failed: why", of an errno. NOT_FOUND when there is no such file, RESOURCE_EXHAUSTED
// when there is no room for it, else INTERNAL; all are PrivateError.
absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error);

}  // namespace pepeseg
