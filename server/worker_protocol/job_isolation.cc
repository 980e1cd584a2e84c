#include "server/worker_protocol/job_isolation.h"

#include <linux/landlock.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace pepeseg {
namespace {

// Variables that workers get. None of them has a secret of the server.
constexpr std::array<std::string_view, 36> kNames = {"PATH",
                                                     "HOME",
                                                     "USER",
                                                     "LOGNAME",
                                                     "SHELL",
                                                     "LANG",
                                                     "LANGUAGE",
                                                     "TZ",
                                                     "LD_LIBRARY_PATH",
                                                     "LD_PRELOAD",
                                                     "TRACEPARENT",
                                                     "XDG_CACHE_HOME",
                                                     "HF_HOME",
                                                     "HF_HUB_OFFLINE",
                                                     "TORCH_HOME",
                                                     "TRITON_CACHE_DIR",
                                                     "PYTHONPATH",
                                                     "PYTHONHOME",
                                                     "PYTHONUNBUFFERED",
                                                     "VIRTUAL_ENV",
                                                     "ASAN_OPTIONS",
                                                     "LSAN_OPTIONS",
                                                     "TSAN_OPTIONS",
                                                     "UBSAN_OPTIONS",
                                                     "MALLOC_ARENA_MAX",
                                                     "OPENBLAS_NUM_THREADS",
                                                     "MKL_NUM_THREADS",
                                                     "SLURMD_NODENAME",
                                                     "SLURM_CLUSTER_NAME",
                                                     "SLURM_CPUS_ON_NODE",
                                                     "SLURM_CPUS_PER_TASK",
                                                     "SLURM_JOB_ID",
                                                     "SLURM_JOB_NAME",
                                                     "SLURM_JOB_PARTITION",
                                                     "SLURM_RESTART_COUNT",
                                                     "SLURM_JOB_GPUS"};
constexpr std::array<std::string_view, 4> kPrefixes = {"LC_", "CUDA_", "NVIDIA_", "OMP_"};

// Whether workers get the variable `name`: it is on the list, or named in `more`.
bool IsForJobs(std::string_view name, const std::vector<std::string>& more) {
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end() ||
         std::find(more.begin(), more.end(), name) != more.end() ||
         std::any_of(kPrefixes.begin(), kPrefixes.end(),
                     [&](std::string_view prefix) { return name.starts_with(prefix); });
}

std::string_view NameOf(std::string_view variable) {
  return variable.substr(0, variable.find('='));
}

}  // namespace

std::vector<std::string> JobEnvironment(const std::vector<std::string>& more) {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    if (IsForJobs(NameOf(*variable), more)) variables.emplace_back(*variable);
  }
  return variables;
}

std::vector<std::string> DatabaseVariables() {
  std::vector<std::string> names;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view name = NameOf(*variable);
    if (name.starts_with("PG")) names.emplace_back(name);
  }
  return names;
}

int LandlockVersion() {
  const long version =
      syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  return static_cast<int>(std::max(version, 0L));
}

std::string MissingFromSandbox(int landlock_version) {
  if (landlock_version < kLandlockRefer) {
    return "this kernel has no Landlock (Linux 5.19 or later, enabled at boot): files are not "
           "limited, so that a job may read and write every file of this user";
  }
  if (landlock_version < kLandlockScopes) {
    return "this kernel is older than Linux 6.12: a program that a job runs may send signals to "
           "other processes of this user";
  }
  return "";
}

}  // namespace pepeseg
