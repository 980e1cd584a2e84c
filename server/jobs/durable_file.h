#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// Replaces `path` by `bytes` so that a reader, or the machine after a power cut, finds the old file
// or the new one and nothing between: temporary file, fsync, rename, fsync of the folder.
absl::Status WriteFileDurably(const std::filesystem::path& path, const std::string& bytes);

// NOT_FOUND when it is not there; RESOURCE_EXHAUSTED when it is over `max_bytes`.
absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& path, size_t max_bytes);

// The end of a file, from a line's start where one is near; empty when there is none.
std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes);

// "PATH: what failed: why (errno)".
absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error);

}  // namespace pepeseg
