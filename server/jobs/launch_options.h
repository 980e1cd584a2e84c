#pragma once

#include <string>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg {

// How a server starts the workers of its jobs, and how often it tries.
struct LaunchOptions {
  enum class Launcher { kProcess, kSlurm };
  Launcher launcher = Launcher::kProcess;
  std::string slurm_partition;  // empty: Slurm's default
  std::string slurm_gres;       // resources of a job on a GPU, as "gpu:1"; empty: none
  std::string slurm_device;     // device of the nodes, as OpenDevice takes it; empty: the server's
  // Store::Open's URL, for workers that Slurm restarts: they take their next fence there.
  std::string database;
  // Lease duration. A server that fails to renew within it loses its jobs to the next claimant.
  int lease_seconds = 30;
  // Pauses before the next attempt after the first, second, third ... crash in a row without
  // progress; the last one repeats. After a crash with progress: the first. Not empty.
  std::vector<absl::Duration> crash_pauses = {absl::Seconds(1), absl::Seconds(10),
                                              absl::Seconds(60)};
  // Longest time between two checkpoints of a job, seconds.
  int checkpoint_seconds = 60;
};

}  // namespace pepeseg
