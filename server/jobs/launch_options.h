#pragma once

#include <string>

namespace pepeseg {

// How a job's worker is started.
struct LaunchOptions {
  enum class Launcher { kProcess, kSlurm };
  Launcher launcher = Launcher::kProcess;
  std::string slurm_partition;  // empty: Slurm's default
  std::string slurm_gres;       // of a job on a GPU, as "gpu:1"; empty: none
  // For workers that Slurm starts again: they take their next fence there. Store::Open's.
  std::string database;
  // A server that is not heard of for so long has lost its jobs to whoever claims them next.
  int lease_seconds = 30;
};

}  // namespace pepeseg
