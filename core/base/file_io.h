#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "absl/status/status.h"
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

// A file that appears under its name complete or not at all, even if power fails. Its bytes go to a
// temporary file next to `path`; Commit syncs it, renames it to `path` and syncs the folder. If the
// object is destroyed before Commit, the temporary file is removed. Not thread safe.
//
// Errors are those of the failed system call, with the path.
class AtomicFile {
 public:
  // Creates the temporary file, with mode 0644. The folder of `path` must exist.
  static absl::StatusOr<AtomicFile> Create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&& other) noexcept;
  ~AtomicFile();

  // Appends bytes to the temporary file.
  absl::Status Append(std::string_view bytes);
  absl::Status Append(std::span<const uint8_t> bytes);
  // Publishes the file, and replaces an older one of that name. Append must not be called after it.
  absl::Status Commit();

 private:
  AtomicFile(std::filesystem::path path, std::string temporary, int descriptor);
  void Discard();

  std::filesystem::path path_;
  std::string temporary_;
  int descriptor_ = -1;
};

// Writes a whole file by an AtomicFile.
absl::Status WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

// Makes names that were created, renamed or removed in `folder` durable (fsync of the folder).
absl::Status SyncFolder(const std::filesystem::path& folder);

}  // namespace pepeseg
