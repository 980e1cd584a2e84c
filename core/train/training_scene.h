#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/dataset/import.h"
#include "core/scene/capture.h"
#include "core/train/stage_log.h"

namespace pepeseg {

// What stage one starts from. The stages before it make it, one after the other.
struct TrainingScene {
  std::vector<DatasetFile> files =
      {};                // of the dataset, and those made of it: frames, poses, priors
  Capture capture = {};  // empty until poses are known
  // Where "poses", "masks" and "depth" came from: "given", "none", "embedded", "sam", "command
  // NAME", or the program that estimated the poses.
  std::map<std::string, std::string> sources = {};
};

// Whether a file of this kind is among them.
bool HasKind(std::span<const DatasetFile> files, FileKind kind);

// "num_views", "num_points", "num_masks" and "num_depth_maps" of a capture.
StageLog::Metrics Counts(const Capture& capture);

}  // namespace pepeseg
