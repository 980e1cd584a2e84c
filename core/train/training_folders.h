#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"

namespace pepeseg {

// Folders below that of a run, each of one stage. They hold what a later run need not do again.
inline constexpr char kHeicFolder[] = "heic";                // JPEGs of HEIC photographs
inline constexpr char kFramesFolder[] = "frames";            // JPEGs of video frames
inline constexpr char kPosesFolder[] = "poses";              // COLMAP's result
inline constexpr char kReconstructFolder[] = "reconstruct";  // stage one's result, as a model

// Where a training leaves the files of its stages and finds those of earlier runs. A training that
// was interrupted is run again with the same inputs and options, in a folder of its own.
struct TrainingFolders {
  std::filesystem::path run = {};  // of this run; gets the model's files at the end
  std::vector<std::filesystem::path> earlier = {};  // of earlier runs, newest first
  std::filesystem::path priors = {};   // of the priors command and SAM, shared by all runs
  std::filesystem::path sfm_log = {};  // COLMAP's output is appended to it

  // This run's, then the earlier ones.
  std::vector<std::filesystem::path> all() const;
};

// Finds the folder `name` of the newest run in which every file agrees with the folder's manifest.
std::optional<std::filesystem::path> FindWhole(const TrainingFolders& folders, const char* name);

// Removes what the stages before the last one left, once there is a model: this run's folders
// above, the folders of earlier runs, and `priors`. Errors are ignored: leftovers only cost space.
void RemoveIntermediates(const TrainingFolders& folders);

// Returns the sum of the sizes of the files in a folder, without subfolders.
absl::StatusOr<int64_t> BytesIn(const std::filesystem::path& folder);

}  // namespace pepeseg
