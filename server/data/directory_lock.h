#pragma once

#include <filesystem>
#include <memory>

#include "absl/status/statusor.h"

namespace pepeseg {

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
