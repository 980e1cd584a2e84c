#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns the bytes of a regular file. Errors call it `name` instead of `path`. NOT_FOUND: there is
// no such file. INVALID_ARGUMENT: it is larger than `max_bytes`, or not a regular file. INTERNAL:
// it cannot be read.
absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path, absl::string_view name,
                                     int64_t max_bytes);

// Returns the size of a regular file in bytes, with the errors of ReadFile.
absl::StatusOr<int64_t> FileSize(const std::filesystem::path& path, absl::string_view name);

// Returns at most the last `max_bytes` bytes of a log, without a line that is cut at its beginning
// (unless no newline is among those bytes). Returns an empty string if the file cannot be opened.
std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes);

}  // namespace pepeseg
