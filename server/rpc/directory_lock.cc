#include "server/rpc/directory_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "server/jobs/file_error.h"
#include "server/layout.h"

namespace pepeseg {

absl::StatusOr<std::unique_ptr<DirectoryLock>> DirectoryLock::Take(
    const std::filesystem::path& data, bool shared) {
  std::error_code error;
  std::filesystem::create_directories(data, error);
  if (error) return FileError(data, "cannot make the folder", error.value());
  const std::filesystem::path path = LockPath(data);
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (descriptor < 0) return FileError(path, "cannot open", errno);
  auto lock = std::unique_ptr<DirectoryLock>(new DirectoryLock(descriptor));
  if (flock(descriptor, (shared ? LOCK_SH : LOCK_EX) | LOCK_NB) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(data.string(), ": another server uses this data directory",
                     shared ? " with a SQLite database of its own" : ""));
  }
  return lock;
}

DirectoryLock::~DirectoryLock() { close(descriptor_); }

}  // namespace pepeseg
