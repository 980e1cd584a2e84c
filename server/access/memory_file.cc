#include "server/access/memory_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

absl::Status SystemError(const char* what) {
  return absl::InternalError(absl::StrCat("file in memory: ", what, ": ", std::strerror(errno)));
}

}  // namespace

MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

absl::Status MemoryFile::Replace(const std::string& text) {
  const int made = memfd_create("pepeseg-tls", MFD_CLOEXEC);
  if (made < 0) return SystemError("cannot make it");
  const timespec time = {next_time_, 0};
  const std::array<timespec, 2> times = {time, time};
  absl::Status status;
  if (write(made, text.data(), text.size()) != static_cast<ssize_t>(text.size()) ||
      futimens(made, times.data()) != 0) {
    status = SystemError("cannot write it");
  } else if (descriptor_ < 0) {
    descriptor_ = made;
  } else if (dup3(made, descriptor_, O_CLOEXEC) < 0) {  // in one step
    status = SystemError("cannot replace it");
  }
  if (made != descriptor_) close(made);
  if (status.ok()) ++next_time_;
  return status;
}

std::string MemoryFile::path() const { return absl::StrCat("/proc/self/fd/", descriptor_); }

}  // namespace pepeseg
