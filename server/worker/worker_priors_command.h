#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "server/worker/worker_job.h"
#include "server/worker/worker_stage_log.h"

namespace pepeseg {

// What a priors command is asked for.
struct PriorWants {
  bool masks = false;
  bool depth = false;
  bool any() const { return masks || depth; }
};

// Runs the operator's program (pepesegd --priors-command), which makes masks and depth maps of
// photographs by whatever means it has:
//
//   PROGRAM --photos FOLDER --out FOLDER --want masks,depth
//
//   --photos   000001.jpg, 000002.png, ...: the photographs that have poses, as they were uploaded
//   --out      where to write; it is there, and empty but for what an attempt that was broken off
//              has left, which need not be made again:
//              masks/STEM.json or .png, depth/STEM.png, .npy or .pfm (far is large), or
//              disparity/STEM.* (near is large), in the formats of an upload (import.h); STEM:
//              000001. Photographs without a file have none. Other files are not looked at.
//   --want     "masks", "depth" or "masks,depth"
//
// A line "progress N M" of its output tells that N of M parts of the work are done. It ends with
// exit code 0, or its last lines tell what went wrong. It is killed, with all of its process group,
// when the job is cancelled or the time limit is over, and has the resource limits of the worker.
//
// `photos`: as files of a dataset, in the order in which they are numbered. The answer: what it
// made, named as an upload would have it ("masks/cam0/7.json"). It is not looked into: the import
// does. Nothing of what is wanted is an error. Both outcomes are kept in the job's folder, so that
// a further attempt of the job has the same priors and need not wait for them again.
//
// CANCELLED: the job was told to stop. Any other error names the program, and ends with what it
// said last.
absl::StatusOr<std::vector<DatasetFile>> RunPriorsCommand(const WorkerJob& job,
                                                          std::span<const DatasetFile> photos,
                                                          PriorWants wants, StageLog& stages);

// "making masks for", "making depth for" or both: what the steps of the stage are.
std::string_view MakingActivity(bool masks, bool depth);

// "command NAME", as a model's source.
std::string SourceOfCommand(const WorkerJob& job);

}  // namespace pepeseg
