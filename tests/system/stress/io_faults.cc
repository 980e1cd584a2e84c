// A library for LD_PRELOAD that makes calls fail by which a program stores or reads files. Without
// these variables it does nothing:
//
//   PEPESEG_FAULT_PROGRAM  name of the program; calls of other programs are not changed
//   PEPESEG_FAULT_FOLDER   folder; only calls on files below it count
//   PEPESEG_FAULT_FILE     part of a path; only calls on paths with it count. Not set: all
//   PEPESEG_FAULT_TRACE    file to which each counted call is appended: its name and the path
//   PEPESEG_FAULT          KIND:N, of which KIND is
//     kill-before, kill-after  SIGKILL at the Nth call of fsync, fdatasync, syncfs, rename,
//     renameat2 or
//                              unlink
//     hang                     the Nth of the same calls never returns
//     full                     from the Nth call on that needs space (write, fsync, open of a new
//                              file), the disk is full
//     unreadable               the Nth call of read or pread fails with EIO
//     unreadable-from          all calls of read and pread from the Nth on fail with EIO
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>

namespace {

template <typename F>
F* Next(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

enum class Fault { kNone, kKillBefore, kKillAfter, kFull, kUnreadable, kUnreadableFrom, kHang };

struct Plan {
  bool meant = false;
  Fault fault = Fault::kNone;
  long number = 0;
  const char* folder = "";
  const char* file = "";
  int trace = -1;
};

// The variables, read once at the first call.
const Plan& ThePlan() {
  static const Plan plan = [] {
    Plan made;
    const char* program = getenv("PEPESEG_FAULT_PROGRAM");
    const char* folder = getenv("PEPESEG_FAULT_FOLDER");
    made.meant = program != nullptr && folder != nullptr &&
                 strcmp(program, program_invocation_short_name) == 0;
    if (!made.meant) return made;
    made.folder = folder;
    if (const char* file = getenv("PEPESEG_FAULT_FILE")) made.file = file;
    if (const char* trace = getenv("PEPESEG_FAULT_TRACE")) {
      made.trace = Next<int(const char*, int, ...)>("open")(
          trace, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    }
    const char* fault = getenv("PEPESEG_FAULT");
    const char* colon = fault == nullptr ? nullptr : strchr(fault, ':');
    if (colon == nullptr) return made;
    made.number = strtol(colon + 1, nullptr, 10);
    const size_t length = static_cast<size_t>(colon - fault);
    const auto is = [&](const char* name) {
      return strlen(name) == length && strncmp(fault, name, length) == 0;
    };
    if (is("kill-before")) made.fault = Fault::kKillBefore;
    if (is("kill-after")) made.fault = Fault::kKillAfter;
    if (is("full")) made.fault = Fault::kFull;
    if (is("unreadable")) made.fault = Fault::kUnreadable;
    if (is("unreadable-from")) made.fault = Fault::kUnreadableFrom;
    if (is("hang")) made.fault = Fault::kHang;
    return made;
  }();
  return plan;
}

std::atomic<long> num_durable{0}, num_space{0}, num_read{0};

bool Below(const char* path) {
  const Plan& plan = ThePlan();
  return plan.meant && path != nullptr && strncmp(path, plan.folder, strlen(plan.folder)) == 0 &&
         strstr(path, plan.file) != nullptr;
}

// Returns the path of a descriptor; empty: it has none.
void PathOf(int descriptor, char* path, size_t size) {
  char link[64];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, path, size - 1);
  path[length > 0 ? length : 0] = '\0';
}

// Sets the path of a name relative to a folder's descriptor. Returns false if it is too long.
bool PathAt(int folder, const char* name, char* path, size_t size) {
  path[0] = '\0';
  if (name[0] != '/' && folder != AT_FDCWD) PathOf(folder, path, size);
  const size_t length = strlen(path);
  const char* separator = length > 0 ? "/" : "";
  const int added = snprintf(path + length, size - length, "%s%s", separator, name);
  return added >= 0 && length + static_cast<size_t>(added) < size;
}

bool IsBelow(int descriptor, char* path, size_t size) {
  if (!ThePlan().meant) return false;
  PathOf(descriptor, path, size);
  return Below(path);
}

void Trace(const char* name, const char* path) {
  const int trace = ThePlan().trace;
  if (trace < 0) return;
  char line[4300];
  const int length = snprintf(line, sizeof(line), "%s %s\n", name, path);
  if (length > 0) {
    (void)!Next<ssize_t(int, const void*, size_t)>("write")(trace, line,
                                                            static_cast<size_t>(length));
  }
}

// Returns whether this is the call at which to kill.
bool CountDurable(const char* name, const char* path) {
  Trace(name, path);
  const long number = ++num_durable;
  const Plan& plan = ThePlan();
  if (number != plan.number) return false;
  if (plan.fault == Fault::kKillBefore) raise(SIGKILL);
  while (plan.fault == Fault::kHang) pause();
  return plan.fault == Fault::kKillAfter;
}

bool NoSpace() {
  const Plan& plan = ThePlan();
  return plan.fault == Fault::kFull && ++num_space >= plan.number;
}

bool Unreadable() {
  const Plan& plan = ThePlan();
  const long number = ++num_read;
  if (plan.fault == Fault::kUnreadableFrom) return number >= plan.number;
  return plan.fault == Fault::kUnreadable && number == plan.number;
}

int Durable(const char* name, int descriptor) {
  char path[4096];
  const auto next = Next<int(int)>(name);
  if (!IsBelow(descriptor, path, sizeof(path))) return next(descriptor);
  if (NoSpace()) {
    errno = ENOSPC;
    return -1;
  }
  const bool kill_after = CountDurable(name, path);
  const int result = next(descriptor);
  if (kill_after) raise(SIGKILL);
  return result;
}

bool RefuseSpace(int descriptor) {
  char path[4096];
  const Plan& plan = ThePlan();
  const bool counts = plan.trace >= 0 || plan.fault == Fault::kFull;
  if (!counts || !IsBelow(descriptor, path, sizeof(path))) return false;
  Trace("write", path);
  if (!NoSpace()) return false;
  errno = ENOSPC;
  return true;
}

bool RefuseRead(int descriptor) {
  char path[4096];
  const Plan& plan = ThePlan();
  const bool counts =
      plan.trace >= 0 || plan.fault == Fault::kUnreadable || plan.fault == Fault::kUnreadableFrom;
  if (!counts || !IsBelow(descriptor, path, sizeof(path))) return false;
  Trace("read", path);
  if (!Unreadable()) return false;
  errno = EIO;
  return true;
}

}  // namespace

extern "C" {

int fsync(int descriptor) { return Durable("fsync", descriptor); }
int syncfs(int descriptor) { return Durable("syncfs", descriptor); }
int fdatasync(int descriptor) { return Durable("fdatasync", descriptor); }

int rename(const char* from, const char* to) {
  const auto next = Next<int(const char*, const char*)>("rename");
  if (!Below(to)) return next(from, to);
  const bool kill_after = CountDurable("rename", to);
  const int result = next(from, to);
  if (kill_after) raise(SIGKILL);
  return result;
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to,
              unsigned int flags) {
  const auto next = Next<int(int, const char*, int, const char*, unsigned int)>("renameat2");
  char path[4096];
  if (!ThePlan().meant || !PathAt(to_folder, to, path, sizeof(path)) || !Below(path)) {
    return next(from_folder, from, to_folder, to, flags);
  }
  const bool kill_after = CountDurable("rename", path);
  const int result = next(from_folder, from, to_folder, to, flags);
  if (kill_after) raise(SIGKILL);
  return result;
}

int unlink(const char* path) {
  const auto next = Next<int(const char*)>("unlink");
  if (!Below(path)) return next(path);
  const bool kill_after = CountDurable("unlink", path);
  const int result = next(path);
  if (kill_after) raise(SIGKILL);
  return result;
}

ssize_t write(int descriptor, const void* bytes, size_t size) {
  if (RefuseSpace(descriptor)) return -1;
  return Next<ssize_t(int, const void*, size_t)>("write")(descriptor, bytes, size);
}

ssize_t pwrite64(int descriptor, const void* bytes, size_t size, off64_t offset) {
  if (RefuseSpace(descriptor)) return -1;
  return Next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64")(descriptor, bytes, size,
                                                                      offset);
}

ssize_t writev(int descriptor, const iovec* parts, int num_parts) {
  if (RefuseSpace(descriptor)) return -1;
  return Next<ssize_t(int, const iovec*, int)>("writev")(descriptor, parts, num_parts);
}

ssize_t read(int descriptor, void* bytes, size_t size) {
  if (RefuseRead(descriptor)) return -1;
  return Next<ssize_t(int, void*, size_t)>("read")(descriptor, bytes, size);
}

ssize_t pread(int descriptor, void* bytes, size_t size, off_t offset) {
  if (RefuseRead(descriptor)) return -1;
  return Next<ssize_t(int, void*, size_t, off_t)>("pread")(descriptor, bytes, size, offset);
}

ssize_t pread64(int descriptor, void* bytes, size_t size, off64_t offset) {
  if (RefuseRead(descriptor)) return -1;
  return Next<ssize_t(int, void*, size_t, off64_t)>("pread64")(descriptor, bytes, size, offset);
}

}  // extern "C"
