#include "server/worker/sandbox/worker_limits.h"

#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fstream>
#include <string>
#include <system_error>

#include "core/base/status_macros.h"
#include "kernels/host_memory.h"

namespace pepeseg {
namespace {

// Room for the largest file of a model: 50 M Gaussians of 62 floats.
constexpr rlim_t kMaxFileBytes = rlim_t{16} << 30;
// CPU seconds of each thread. A reference training takes hours, so a week means an endless loop.
constexpr rlim_t kMaxSeconds = 7 * 24 * 3600;
constexpr rlim_t kMaxOpenFiles = 256;

// Lowers the soft and the hard limit of a resource to `value`. Never raises one.
absl::Status Limit(decltype(RLIMIT_AS) resource, rlim_t value) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) {
    return absl::InternalError("getrlimit: " + std::generic_category().message(errno));
  }
  limit.rlim_max = std::min(limit.rlim_max, value);
  limit.rlim_cur = limit.rlim_max;
  if (setrlimit(resource, &limit) == 0) return absl::OkStatus();
  return absl::InternalError("setrlimit: " + std::generic_category().message(errno));
}

}  // namespace

absl::Status LimitResources(int64_t memory_limit, int num_threads) {
  const int64_t memory = memory_limit > 0 ? memory_limit : HostMemory().total_bytes;
  // Not RLIMIT_AS: CUDA reserves address space as large as all memory of host and devices, and
  // touches none of it.
  if (!kSanitized) RETURN_IF_ERROR(Limit(RLIMIT_DATA, static_cast<rlim_t>(memory)));
  const long threads = num_threads > 0 ? num_threads : sysconf(_SC_NPROCESSORS_ONLN);
  RETURN_IF_ERROR(Limit(RLIMIT_CPU, kMaxSeconds * static_cast<rlim_t>(std::max(threads, 1L))));
  RETURN_IF_ERROR(Limit(RLIMIT_FSIZE, kMaxFileBytes));
  RETURN_IF_ERROR(Limit(RLIMIT_NOFILE, kMaxOpenFiles));
  RETURN_IF_ERROR(Limit(RLIMIT_CORE, 0));
  // With the signal ignored, a write beyond the limit fails with EFBIG instead of ending the
  // process.
  std::signal(SIGXFSZ, SIG_IGN);
  return absl::OkStatus();
}

absl::Status LimitPhotograph() {
  // Limits of a decoder: an image takes far less, unless its file was made to take more.
  constexpr rlim_t kMemory = rlim_t{2} << 30, kSeconds = 10, kFileBytes = rlim_t{128} << 20;
  if (!kSanitized) RETURN_IF_ERROR(Limit(RLIMIT_DATA, kMemory));
  RETURN_IF_ERROR(Limit(RLIMIT_CPU, kSeconds));
  RETURN_IF_ERROR(Limit(RLIMIT_FSIZE, kFileBytes));
  RETURN_IF_ERROR(Limit(RLIMIT_NOFILE, kMaxOpenFiles));
  RETURN_IF_ERROR(Limit(RLIMIT_CORE, 0));
  std::signal(SIGXFSZ, SIG_IGN);
  return absl::OkStatus();
}

int64_t MemoryLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_DATA, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return 0;
  return static_cast<int64_t>(limit.rlim_cur);
}

absl::Status EndWithParent(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // If the parent ended before that call, the kernel sends no signal.
  if (getppid() != parent) return absl::CancelledError("the server has ended");
  return absl::OkStatus();
}

void YieldToServer() {
  constexpr int kNicer = 5;
  setpriority(PRIO_PROCESS, 0, kNicer);
  // If memory runs out, the kernel should kill a worker, whose job resumes, rather than the server.
  std::ofstream("/proc/self/oom_score_adj") << 500;
}

}  // namespace pepeseg
