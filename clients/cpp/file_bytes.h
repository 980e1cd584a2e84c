#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Files of the machine that the client runs on.
namespace pepeseg::client {

// "cannot ACTION PATH: TEXT OF errno". NOT_FOUND for ENOENT and ENOTDIR; else PERMISSION_DENIED,
// RESOURCE_EXHAUSTED (the disk is full) or FAILED_PRECONDITION.
absl::Status LocalFileError(absl::string_view action, const std::filesystem::path& path,
                            int error_number);
// NOT_FOUND with a message of its own.
absl::Status LocalFileMissing(const std::string& message);
// Whether one of these two made it: no server had a part in it.
bool IsLocalFileError(const absl::Status& status);

// LocalFileError names the file.
absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path);

// Makes the folders above `file`. LocalFileError names the folder.
absl::Status MakeParentFolder(const std::filesystem::path& file);

// Writes a temporary file in the same folder, which it makes if needed, and renames it, so that no
// reader sees half of it. LocalFileError names the file.
absl::Status WriteFile(const std::filesystem::path& path, absl::string_view bytes);

// A file that is written piece by piece, and takes its place only when it is whole. Not thread
// safe.
class OutputFile {
 public:
  // Makes the folders above it. Errors: as WriteFile.
  static absl::StatusOr<OutputFile> Create(const std::filesystem::path& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  // Unless committed, removes what was written.
  ~OutputFile();

  absl::Status Append(absl::string_view bytes);
  int64_t num_bytes() const { return num_bytes_; }  // appended so far
  absl::Status Commit();

 private:
  OutputFile(std::filesystem::path path, int descriptor);
  absl::Status Fail(int error_number) const;

  std::filesystem::path path_, beside_;
  int descriptor_;  // -1: closed
  int64_t num_bytes_ = 0;
};

}  // namespace pepeseg::client
