#pragma once

#include <filesystem>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"

namespace pepeseg {

// An open file with the system's advisory lock on it, which goes with the object, or with its
// process, however that ends. It holds between the objects of one process, too. Not thread safe.
class LockedFile {
 public:
  // For one holder; makes the file when it is not there. ABORTED: another has it. NOT_FOUND: there
  // is no such folder. The file is the one that has this name now, though another holder may have
  // renamed or removed what had it before.
  static absl::StatusOr<LockedFile> TryAlone(const std::filesystem::path& path);
  // Wait for their turn: a file that is never removed.
  static absl::StatusOr<LockedFile> WaitAlone(const std::filesystem::path& path);
  static absl::StatusOr<LockedFile> WaitShared(const std::filesystem::path& path);

  LockedFile(LockedFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  LockedFile& operator=(LockedFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~LockedFile();

  int descriptor() const { return descriptor_; }

 private:
  explicit LockedFile(int descriptor) : descriptor_(descriptor) {}
  static absl::StatusOr<LockedFile> Open(const std::filesystem::path& path, int operation);
  int descriptor_ = -1;
};

// Holds a data directory for this process, or shares it with others that do, as long as it lives;
// the system lets it go with the process, however that ends.
class DirectoryLock {
 public:
  // Makes the directory, for its owner only. FAILED_PRECONDITION: another process holds it for
  // itself, or at all when it is not to be `shared`.
  static absl::StatusOr<std::unique_ptr<DirectoryLock>> Take(const std::filesystem::path& data,
                                                             bool shared);
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  explicit DirectoryLock(int descriptor) : descriptor_(descriptor) {}
  const int descriptor_;
};

}  // namespace pepeseg
