#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "core/dataset/import.h"
#include "core/train/training_folders.h"

namespace pepeseg {

// The operator's program that makes masks and depth maps, see priors_command.h.
struct PriorsCommand {
  std::filesystem::path program;  // empty: none
  absl::Duration time_limit = absl::Hours(1);
};

// Programs, networks and limits of the machine that trains.
struct TrainingTools {
  std::string colmap = "colmap";  // a path, or a name that is looked up in PATH
  PriorsCommand priors_command;
  std::filesystem::path sam;            // folder of SAM's files (sam_files.h); empty: no SAM
  std::optional<int> sam_cuda_device;   // absent: SAM computes on the CPU
  std::filesystem::path lpips_weights;  // ONNX, see core/evaluate/lpips.h; empty: no LPIPS
  int num_threads = 0;                  // 0: as many as there are cores
  int64_t memory_limit = 0;  // bytes that this process may allocate, for messages; 0: unlimited
};

// What a training starts from.
struct TrainingInputs {
  std::vector<DatasetFile> files;
  // Declared SHA-256 of each file, in hexadecimal. Empty: the bytes are not verified.
  std::vector<std::string> sha256;
  TrainingFolders folders;
  TrainingTools tools;
  std::map<std::string, std::string> facts;  // added to Model::facts
};

}  // namespace pepeseg
