#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

// A Slurm cluster on this host: a controller and some nodes of two cores, on free ports and in a
// new folder. Needs root and Debian's slurmctld, slurmd, slurm-client and munge. The destructor
// kills it. Slurm's programs find it by SLURM_CONF.
class SlurmCluster {
 public:
  static bool IsInstalled();

  explicit SlurmCluster(int num_nodes);
  ~SlurmCluster();
  SlurmCluster(const SlurmCluster&) = delete;
  SlurmCluster& operator=(const SlurmCluster&) = delete;

  std::string environment() const { return "SLURM_CONF=" + (folder_ / "slurm.conf").string(); }
  // Returns the node that runs a job of that name; empty: none does.
  std::string NodeOf(const std::string& job_name) const;
  // Kills (SIGKILL) the node's daemon and everything that it runs.
  void KillNode(const std::string& node);

 private:
  void WriteConfiguration(int num_nodes);
  pid_t Launch(const std::vector<std::string>& words, const std::string& log);
  std::string Ask(const std::string& command) const;

  TempFolder folder_;
  std::vector<pid_t> daemons_;
  std::vector<std::pair<std::string, pid_t>> nodes_;
};

}  // namespace pepeseg::testing
