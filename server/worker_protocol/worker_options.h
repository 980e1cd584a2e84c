#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace pepeseg {

// What the operator's flags say about workers: the same for each job of a server. Each job's spec
// has a copy.
struct WorkerOptions {
  // Limits a worker to what its job needs (worker/sandbox/worker_sandbox.h).
  bool sandbox = true;
  // Absolute paths of files and folders that workers read and run besides what every job needs.
  std::vector<std::string> sandbox_reads;
  // Names of variables of the server's environment that workers get besides JobEnvironment's.
  std::vector<std::string> pass_environment;
  std::string colmap = "colmap";  // estimates poses: a path, or a name that is looked up in PATH
  // The program that makes masks and depth maps (core/train/priors_command.h), and its time limit
  // for one job; empty: none. A path, or a name that the server looks up in PATH.
  std::string priors_command;
  int64_t priors_seconds = 3600;
  // Folder of SAM's files (core/priors/sam/sam_files.h), which workers verify before they use them;
  // empty: none.
  std::filesystem::path sam;
  std::filesystem::path lpips_weights;  // ONNX, see core/evaluate/lpips.h; empty: no LPIPS
  std::string log_format = "text";      // of the worker's log, as LogFormatOf takes it

  bool operator==(const WorkerOptions&) const = default;
};

}  // namespace pepeseg
