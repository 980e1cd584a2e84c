#pragma once

#include <filesystem>
#include <vector>

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "core/train/stage_log.h"
#include "core/train/training_folders.h"

namespace pepeseg {

// Appends the frames that stand for the videos among `files`, at most `max_frames` of each, as
// photographs: "images/walk_000123.jpg" of videos/walk.mp4. Takes them from an earlier run that has
// extracted all of them. Reports steps of stage "prepare". Errors as ExtractFrames.
absl::Status AppendVideoFrames(const TrainingFolders& folders, int max_frames, StageLog& stages,
                               std::vector<DatasetFile>& files);

// Whether AppendVideoFrames has made the file, in this run or in an earlier one.
bool IsVideoFrame(const TrainingFolders& folders, const std::filesystem::path& path);

}  // namespace pepeseg
