#include "server/data/locked_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

constexpr mode_t kFileMode = 0644;

// Returns whether the open file is the one that has this path now.
bool HasThisName(int descriptor, const std::filesystem::path& path) {
  struct stat opened {};
  struct stat named {};
  return fstat(descriptor, &opened) == 0 && stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

// Creates the data directory with mode 0700: it holds photographs and the digests of keys.
absl::Status MakeFolder(const std::filesystem::path& data) {
  const std::filesystem::path folder = data.has_filename() ? data : data.parent_path();
  std::error_code error;
  std::filesystem::create_directories(folder.parent_path(), error);
  if (error) return FileError(data, "cannot make the folder", error.value());
  // An existing folder keeps the mode that its owner gave it.
  if (mkdir(folder.c_str(), 0700) == 0) return absl::OkStatus();
  const int made = errno;
  if (made != EEXIST) return FileError(data, "cannot make the folder", made);
  if (std::filesystem::is_directory(folder, error)) return absl::OkStatus();
  return FileError(data, "cannot make the folder", ENOTDIR);
}

}  // namespace

absl::StatusOr<LockedFile> LockedFile::Open(const std::filesystem::path& path, int operation) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (descriptor < 0) return FileError(path, "cannot open", errno);
  LockedFile file(descriptor);
  // flock belongs to the open file, so it also keeps two streams of one process apart, and ends
  // with the process however that ends.
  while (flock(descriptor, operation) != 0) {
    if (errno == EINTR) continue;
    if (errno == EWOULDBLOCK)
      return absl::AbortedError(path.string() + ": is locked by another process or stream");
    return FileError(path, "cannot lock", errno);
  }
  return file;
}

// The file may be renamed or removed between open and flock, by a holder that publishes or collects
// it. The lock is then on a file without this name: try again with the current one.
absl::StatusOr<LockedFile> LockedFile::TryAlone(const std::filesystem::path& path) {
  constexpr int kTries = 10;
  for (int i = 0; i < kTries; ++i) {
    ASSIGN_OR_RETURN(LockedFile file, Open(path, LOCK_EX | LOCK_NB));
    if (HasThisName(file.descriptor(), path)) return file;
  }
  return absl::AbortedError(path.string() + ": others keep removing it");
}

absl::StatusOr<LockedFile> LockedFile::WaitAlone(const std::filesystem::path& path) {
  return Open(path, LOCK_EX);
}

absl::StatusOr<LockedFile> LockedFile::WaitShared(const std::filesystem::path& path) {
  return Open(path, LOCK_SH);
}

LockedFile::~LockedFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

absl::StatusOr<std::unique_ptr<DirectoryLock>> DirectoryLock::Take(
    const std::filesystem::path& data, bool shared) {
  RETURN_IF_ERROR(MakeFolder(data));
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
