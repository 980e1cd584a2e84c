#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"

namespace pepeseg {

// Priors requested from a priors command.
struct PriorWants {
  bool masks = false;
  bool depth = false;
  bool any() const { return masks || depth; }
};

// Runs the operator's program (pepesegd --priors-command), which makes masks and depth maps of
// photographs by any means:
//
//   PROGRAM --photos FOLDER --out FOLDER --want masks,depth
//
//   --photos   000001.jpg, 000002.png, ...: the photographs that have poses, upright, as JPEGs or
//   PNGs
//              with 8 bits a channel and without alpha (plain_copy.h)
//   --out      where to write. The folder exists, and is empty but for what an earlier run that was
//              interrupted has left there, which need not be made again:
//              masks/STEM.json or .png, depth/STEM.png, .npy or .pfm (far is large), or
//              disparity/STEM.* (near is large), in the formats of an upload (import.h); STEM:
//              000001. A photograph without a file has no mask or depth. Other files are ignored.
//   --want     "masks", "depth" or "masks,depth"
//
// A line "progress N M" of its output reports that N of M parts of the work are done. It ends with
// exit code 0, or its last lines say what went wrong. It is killed, with its process group, when
// the training is cancelled or the time limit has passed, and inherits the resource limits of this
// process.
//
// photos: files of the dataset, in the order in which they are numbered. Returns the files that the
// program made, named as in an upload ("masks/cam0/7.json"); the import checks their contents.
// Success and failure are both kept in `folders.priors`, so that a later run of the training has
// the same priors without running the program again.
//
// Returns CANCELLED when the training was cancelled. Any other error, also when the program made
// none of the wanted files, has the program's name and the last lines of its output.
absl::StatusOr<std::vector<DatasetFile>> RunPriorsCommand(const TrainingInputs& inputs,
                                                          std::span<const DatasetFile> photos,
                                                          PriorWants wants, StageLog& stages);

// Returns the activity of steps of stage "priors": "making masks for", "making depth for", or both.
std::string_view MakingActivity(bool masks, bool depth);

// Returns "command NAME", the source of a model's masks or depth.
std::string SourceOfCommand(const PriorsCommand& command);

}  // namespace pepeseg
