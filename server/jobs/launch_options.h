#pragma once

#include <string>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg {

// How a job's worker is started.
struct LaunchOptions {
  enum class Launcher { kProcess, kSlurm };
  Launcher launcher = Launcher::kProcess;
  std::string slurm_partition;  // empty: Slurm's default
  std::string slurm_gres;       // of a job on a GPU, as "gpu:1"; empty: none
  std::string slurm_device;     // of the nodes, as OpenDevice takes it; empty: the server's
  // Workers limit themselves to what a job needs (worker_sandbox.h).
  bool sandbox = true;
  // Absolute paths of files and folders that they read and run besides what every job needs.
  std::vector<std::string> sandbox_reads;
  // Folder of SAM's files, for masks (core/priors/sam/sam_files.h), which workers check before they
  // use it; empty: none.
  std::string sam;
  // Names of variables of the server's environment that they get besides JobEnvironment's.
  std::vector<std::string> pass_environment;
  // For workers that Slurm starts again: they take their next fence there. Store::Open's.
  std::string database;
  // A server that is not heard of for so long has lost its jobs to whoever claims them next.
  int lease_seconds = 30;
  // Pauses before the next attempt after the first, second, third ... crash in a row without
  // progress; the last one repeats. After a crash with progress: the first. Not empty.
  std::vector<absl::Duration> crash_pauses = {absl::Seconds(1), absl::Seconds(10),
                                              absl::Seconds(60)};
  // How often a worker saves what it has, at least.
  int checkpoint_seconds = 60;
};

}  // namespace pepeseg
