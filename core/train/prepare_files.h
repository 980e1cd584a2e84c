#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "core/train/stage_log.h"
#include "core/train/training_inputs.h"
#include "core/train/training_observer.h"

// Stage "prepare": converts the files of a dataset to photographs that every later stage can read.
namespace pepeseg {

// Compares the SHA-256 of each input file with the declared one before anything is decoded, so that
// bytes that a disk has changed since the upload are never trained on. Reads each distinct file
// once, on `tools.num_threads` threads. Does nothing if no digests were declared.
//
// Returns DATA_LOSS, with the owner's name of the first file whose stored bytes are damaged or gone
// and the number of such files; each of their digests is reported to the observer once. Returns
// INTERNAL, with the name, for a file that cannot be read: its bytes may be good.
absl::Status VerifyFiles(const TrainingInputs& inputs, TrainingObserver& observer);

// Reads given Gaussians before any stage runs, so that a bad file is an error at once. Returns the
// errors of ReadGaussianPly.
absl::Status CheckGivenGaussians(const std::vector<DatasetFile>& files);

// Converts each HEIC photograph among `files` to a JPEG in this run's folder, or takes the JPEGs of
// an earlier run that has converted all. Changes the files' paths to the JPEGs and keeps their
// names, so that everything afterwards, COLMAP and priors commands too, reads the JPEGs. Reports
// steps of stage "prepare". Returns the errors of HeicToJpeg.
absl::Status ConvertHeicPhotographs(const TrainingFolders& folders, StageLog& stages,
                                    std::vector<DatasetFile>& files);

// Appends frames of the videos among `files`, at most `max_frames` of each, as photographs:
// "images/walk_000123.jpg" of videos/walk.mp4. Extracts them, or takes those of an earlier run that
// has extracted all. Reports steps of stage "prepare". Returns the errors of ExtractFrames.
absl::Status AppendVideoFrames(const TrainingFolders& folders, int max_frames, StageLog& stages,
                               std::vector<DatasetFile>& files);

// Returns true if AppendVideoFrames has made the file, in this run or in an earlier one.
bool IsVideoFrame(const TrainingFolders& folders, const std::filesystem::path& path);

}  // namespace pepeseg
