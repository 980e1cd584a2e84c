#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The whole of a regular file. `name` stands for it in errors. NOT_FOUND: there is none;
// INVALID_ARGUMENT: over `max_bytes`, or not a regular file.
absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path, absl::string_view name,
                                     int64_t max_bytes);

// The size of a regular file in bytes, with the errors of ReadFile.
absl::StatusOr<int64_t> FileSize(const std::filesystem::path& path, absl::string_view name);

// Returns at most the last `max_bytes` bytes of a log, from the start of a line where one is among
// them; empty when there is no such file.
std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes);

}  // namespace pepeseg
