#include "server/observe/process_use.h"

#include <sys/resource.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

namespace pepeseg {
namespace {

int CountEntries(const char* folder) {
  std::error_code error;
  const std::filesystem::directory_iterator entries(folder, error);
  return error ? 0 : static_cast<int>(std::distance(begin(entries), end(entries)));
}

int64_t MaxDescriptors() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return 0;
  return static_cast<int64_t>(limit.rlim_cur);
}

absl::Duration CpuTime() {
  rusage use{};
  if (getrusage(RUSAGE_SELF, &use) != 0) return absl::ZeroDuration();
  return absl::DurationFromTimeval(use.ru_utime) + absl::DurationFromTimeval(use.ru_stime);
}

}  // namespace

ProcessUse MeasureProcess() {
  ProcessUse use;
  std::ifstream file("/proc/self/statm");
  int64_t size = 0, resident = 0;
  if (file >> size >> resident) use.resident_bytes = resident * sysconf(_SC_PAGESIZE);
  use.num_descriptors = CountEntries("/proc/self/fd");
  use.max_descriptors = MaxDescriptors();
  use.num_threads = CountEntries("/proc/self/task");
  use.cpu_time = CpuTime();
  return use;
}

int64_t DiskFreeBytes(const std::filesystem::path& folder) {
  struct statvfs system {};
  if (statvfs(folder.c_str(), &system) != 0) return -1;
  return static_cast<int64_t>(system.f_bavail) * static_cast<int64_t>(system.f_frsize);
}

}  // namespace pepeseg
