#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Reads and writes files of the machine that the client runs on.
namespace pepeseg::client {

// Returns an error "cannot ACTION PATH: TEXT OF errno". NOT_FOUND: ENOENT or ENOTDIR;
// PERMISSION_DENIED; RESOURCE_EXHAUSTED: the disk is full; FAILED_PRECONDITION: anything else.
absl::Status LocalFileError(absl::string_view action, const std::filesystem::path& path,
                            int error_number);
// Returns NOT_FOUND with this message.
absl::Status LocalFileMissing(const std::string& message);
// Returns true if one of these two functions made `status`: then no server took part in the error.
bool IsLocalFileError(const absl::Status& status);

// Returns all bytes of a file. LocalFileError: it cannot be read.
absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path);

// Creates the folders above `file`. LocalFileError: a folder cannot be created.
absl::Status MakeParentFolder(const std::filesystem::path& file);

// Writes a file at once, as OutputFile does: no reader sees a part of it. LocalFileError: it cannot
// be written.
absl::Status WriteFile(const std::filesystem::path& path, absl::string_view bytes);

// A file that is written piece by piece as PATH.part and renamed to PATH by Commit, so that no
// reader sees a part of it. It is not synced: a crash of the machine may lose it. Not thread safe.
class OutputFile {
 public:
  // Creates the folders above `path`, and PATH.part. LocalFileError: `path` cannot be written.
  static absl::StatusOr<OutputFile> Create(const std::filesystem::path& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  // Removes PATH.part unless it was committed.
  ~OutputFile();

  absl::Status Append(absl::string_view bytes);
  int64_t num_bytes() const { return num_bytes_; }  // appended so far
  // Closes and renames the file; call it once, last. On an error nothing is left of the file.
  absl::Status Commit();

 private:
  OutputFile(std::filesystem::path path, int descriptor);
  absl::Status Fail(int error_number) const;

  std::filesystem::path path_, part_;
  int descriptor_;  // -1: closed
  int64_t num_bytes_ = 0;
};

}  // namespace pepeseg::client
