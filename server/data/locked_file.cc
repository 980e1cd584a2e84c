#include "server/data/locked_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "core/base/file_error.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr mode_t kFileMode = 0644;

bool HasThisName(int descriptor, const std::filesystem::path& path) {
  struct stat opened {};
  struct stat named {};
  return fstat(descriptor, &opened) == 0 && stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

}  // namespace

absl::StatusOr<LockedFile> LockedFile::Open(const std::filesystem::path& path, int operation) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kFileMode);
  if (descriptor < 0) return FileError(path, "cannot open", errno);
  LockedFile file(descriptor);
  while (flock(descriptor, operation) != 0) {
    if (errno == EINTR) continue;
    if (errno == EWOULDBLOCK) return absl::AbortedError(path.string() + ": another has it");
    return FileError(path, "cannot lock", errno);
  }
  return file;
}

absl::StatusOr<LockedFile> LockedFile::TryAlone(const std::filesystem::path& path) {
  constexpr int kTries = 10;
  for (int i = 0; i < kTries; ++i) {
    ASSIGN_OR_RETURN(LockedFile file, Open(path, LOCK_EX | LOCK_NB));
    if (HasThisName(file.descriptor(), path)) return file;
  }
  return absl::AbortedError(path.string() + ": others take it away");
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

}  // namespace pepeseg
