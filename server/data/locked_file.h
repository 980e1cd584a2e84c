#pragma once

#include <filesystem>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"

namespace pepeseg {

// An open file with an advisory lock (flock), which is released with the object, or by the system
// when the process ends, however it ends. Objects of one process exclude each other, too. Not
// thread safe.
class LockedFile {
 public:
  // Takes the exclusive lock without waiting; creates the file if there is none. ABORTED: another
  // holder has it. NOT_FOUND: the folder does not exist. Another holder may rename or remove the
  // file while this call opens it; the file returned is one that has this name after it was locked.
  static absl::StatusOr<LockedFile> TryAlone(const std::filesystem::path& path);
  // Wait for the exclusive or a shared lock. For files that are never removed or renamed.
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

// The lock of a server on its data directory: exclusive, or shared with other servers. Released
// with the object, or by the system when the process ends.
class DirectoryLock {
 public:
  // Creates the directory if there is none, readable by its owner only, and locks it without
  // waiting. FAILED_PRECONDITION: another process holds it exclusively, or holds it at all and
  // `shared` is false.
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
