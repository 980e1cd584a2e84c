#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/dataset/import.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Folders below a run's folder, each with the result of one stage, which a later run can reuse.
inline constexpr char kHeicFolder[] = "heic";                // JPEGs of HEIC photographs
inline constexpr char kFramesFolder[] = "frames";            // JPEGs of video frames
inline constexpr char kPosesFolder[] = "poses";              // COLMAP's result
inline constexpr char kReconstructFolder[] = "reconstruct";  // stage one's result, as a model
inline constexpr char kEarlyFolder[] = "early";  // a first model for clicks, see EarlyField
inline constexpr char kGivenFolder[] = "given";  // given Gaussians, as a model

// Where a training leaves the files of its stages and finds those of earlier runs. A training that
// was interrupted is run again with the same inputs and options, in a folder of its own.
struct TrainingFolders {
  std::filesystem::path run = {};  // of this run; gets the model's files at the end
  std::vector<std::filesystem::path> earlier = {};  // of earlier runs, newest first
  std::filesystem::path priors = {};   // of the priors command and SAM, shared by all runs
  std::filesystem::path sfm_log = {};  // COLMAP's output is appended to it

  // Returns this run's folder, then those of earlier runs.
  std::vector<std::filesystem::path> all() const;
};

// The operator's program that makes masks and depth maps, see priors_command.h.
struct PriorsCommand {
  std::filesystem::path program;  // empty: none
  absl::Duration time_limit = absl::Hours(1);
};

// Programs, networks and limits of the machine that trains.
struct TrainingTools {
  std::string colmap = "colmap";  // a path, or a name that is looked up in PATH
  PriorsCommand priors_command;
  std::filesystem::path sam;            // folder that deploy/sam.sh has made; empty: no SAM
  std::optional<int> sam_cuda_device;   // absent: SAM computes on the CPU
  bool keep_embeddings = true;          // of photographs by SAM, with the model
  std::filesystem::path lpips_weights;  // ONNX, see core/evaluate/lpips.h; empty: no LPIPS
  int num_threads = 0;                  // 0: as many as there are cores
  int64_t memory_limit = 0;  // bytes that this process may allocate, for messages; 0: unlimited
};

// Everything that a training reads, besides its settings.
struct TrainingInputs {
  std::vector<DatasetFile> files;
  // Declared SHA-256 of each file, in hexadecimal. Empty: the bytes are not verified.
  std::vector<std::string> sha256;
  TrainingFolders folders;
  TrainingTools tools;
  std::map<std::string, std::string> facts;  // added to Model::facts
};

// Where an input of stage one or two came from.
struct Source {
  enum class Kind { kUnknown, kNone, kGiven, kEmbedded, kSam, kSamAndEmbedded, kProgram };

  Kind kind = Kind::kUnknown;  // kUnknown: the stage that decides it has not run
  std::string program = {};    // kProgram: "command NAME", or what estimated the poses

  bool none() const { return kind == Kind::kNone; }
};
struct Sources {
  Source poses, masks, depth;
};

// Returns the source as models and clients name it: "none", "given", "embedded", "sam", "sam and
// embedded" or the program; empty for kUnknown.
std::string TextOf(const Source& source);
// Returns the texts of the known sources under "poses", "masks" and "depth".
std::map<std::string, std::string> ByName(const Sources& sources);

// Input of stage one, filled in by the stages before it.
struct TrainingScene {
  // Files of the dataset, and those made from it: frames, poses, priors.
  std::vector<DatasetFile> files = {};
  Capture capture = {};  // empty until poses are known
  Sources sources = {};
};

// Returns true if one of the files is of this kind.
bool HasKind(std::span<const DatasetFile> files, FileKind kind);

// Returns the folder of what SAM has made of photographs.
inline std::filesystem::path SamFolder(const TrainingFolders& folders) {
  return folders.priors / "sam";
}

// Returns the folder `name` of the newest run in which every file agrees with the folder's
// manifest; nullopt: there is none.
std::optional<std::filesystem::path> FindWhole(const TrainingFolders& folders, const char* name);

// Removes the results of intermediate stages, once there is a model: this run's folders above, the
// folders of earlier runs, and `priors`. Errors are ignored: leftovers only cost space.
void RemoveIntermediates(const TrainingFolders& folders);

// Returns the sum of the sizes of the files in a folder, without subfolders.
absl::StatusOr<int64_t> BytesIn(const std::filesystem::path& folder);

}  // namespace pepeseg
