#pragma once

#include <vector>

#include "absl/status/status.h"
#include "core/dataset/import.h"
#include "core/train/stage_log.h"
#include "core/train/training_folders.h"

namespace pepeseg {

// Converts each HEIC photograph among `files` to a JPEG in this run's folder, to which the file's
// path then leads; its name stays. What runs afterwards, COLMAP and priors commands too, reads the
// JPEGs. Takes them from an earlier run that has converted all of them. Reports steps of stage
// "prepare". Errors as HeicToJpeg.
absl::Status ConvertHeicPhotographs(const TrainingFolders& folders, StageLog& stages,
                                    std::vector<DatasetFile>& files);

}  // namespace pepeseg
