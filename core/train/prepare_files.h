#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"
#include "core/train/training_observer.h"

// Stage "prepare": from the files of a dataset to photographs that every later stage can read.
namespace pepeseg {

// Compares the SHA-256 of each input file with the declared one, before anything is decoded: what a
// disk has changed since the upload is never trained on. Reads each distinct file once, on
// `tools.num_threads` threads. Does nothing where no digests were declared.
//
// DATA_LOSS names the first file whose stored bytes are damaged or gone, as its owner calls it, and
// says how many there are; each of their digests is reported to the observer once. INTERNAL names a
// file that cannot be read: nothing is known of its bytes then.
absl::Status VerifyFiles(const TrainingInputs& inputs, TrainingObserver& observer);

// Converts each HEIC photograph among `files` to a JPEG in this run's folder, to which the file's
// path then leads; its name stays. What runs afterwards, COLMAP and priors commands too, reads the
// JPEGs. Takes them from an earlier run that has converted all of them. Reports steps of stage
// "prepare". Errors as HeicToJpeg.
absl::Status ConvertHeicPhotographs(const TrainingFolders& folders, StageLog& stages,
                                    std::vector<DatasetFile>& files);

// Appends the frames that stand for the videos among `files`, at most `max_frames` of each, as
// photographs: "images/walk_000123.jpg" of videos/walk.mp4. Takes them from an earlier run that has
// extracted all of them. Reports steps of stage "prepare". Errors as ExtractFrames.
absl::Status AppendVideoFrames(const TrainingFolders& folders, int max_frames, StageLog& stages,
                               std::vector<DatasetFile>& files);

// Whether AppendVideoFrames has made the file, in this run or in an earlier one.
bool IsVideoFrame(const TrainingFolders& folders, const std::filesystem::path& path);

}  // namespace pepeseg
