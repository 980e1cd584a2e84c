#include "core/train/pose_stage.h"

#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/sfm/estimate_poses.h"
#include "core/train/prepare_files.h"

namespace pepeseg {
namespace {

// Returns the poses of the newest earlier run that has some, or else estimates them. This run's own
// folder has none yet.
absl::StatusOr<EstimatedPoses> FindOrEstimate(const TrainingInputs& inputs,
                                              const SfmOptions& options,
                                              const std::vector<SfmPhotograph>& photographs,
                                              Backend& backend, StageLog& stages) {
  const TrainingFolders& folders = inputs.folders;
  // An unreadable or damaged folder is the same as none: the next one is tried.
  for (const std::filesystem::path& run : folders.earlier) {
    absl::StatusOr<EstimatedPoses> earlier = ReadEstimatedPoses(run / kPosesFolder);
    if (!earlier.ok()) continue;
    stages.observer().Log(absl::StrCat("poses were estimated by ", run.filename().string()));
    return earlier;
  }
  const SfmPlaces places{inputs.tools.colmap, folders.run / "sfm", folders.run / kPosesFolder,
                         folders.sfm_log, inputs.tools.num_threads};
  const auto progress = [&](const StepReport& report) { return stages.StepIfNew(report); };
  const auto warn = [&](absl::string_view message) { stages.Warn(std::string(message)); };
  return EstimatePoses(photographs, places, options, {backend, progress, warn});
}

}  // namespace

absl::StatusOr<std::vector<SfmPhotograph>> PhotographsWithoutPoses(
    const std::vector<DatasetFile>& files, const TrainingFolders& folders) {
  // Their coordinates would mean nothing in the frame that COLMAP will choose.
  for (const DatasetFile& file : files) {
    if (file.kind != FileKind::kGaussians && file.kind != FileKind::kPoints) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        file.name, " is in the frame of poses that are not among the files: upload those (",
        "COLMAP's sparse/0/cameras and images), or the photographs without it"));
  }
  ASSIGN_OR_RETURN(std::vector<SfmPhotograph> photographs, ReadSfmPhotographs(files));
  for (SfmPhotograph& photograph : photographs) {
    photograph.is_video_frame = IsVideoFrame(folders, photograph.path);
  }
  return photographs;
}

absl::StatusOr<PosesMade> AppendPoses(const TrainingInputs& inputs, const SfmOptions& options,
                                      const std::vector<SfmPhotograph>& photographs,
                                      Backend& backend, StageLog& stages,
                                      std::vector<DatasetFile>& files) {
  const Polling polling(stages.observer());
  ASSIGN_OR_RETURN(const EstimatedPoses poses,
                   FindOrEstimate(inputs, options, photographs, backend, stages));
  // From here on they are files of the dataset like uploaded ones.
  files.push_back({FileKind::kPoses, "sparse/0/cameras.bin", poses.cameras});
  files.push_back({FileKind::kPoses, "sparse/0/images.bin", poses.images});
  files.push_back({FileKind::kPoints, "sparse/0/points3D.bin", poses.points});
  return PosesMade{poses.program,
                   {.num_photographs = static_cast<double>(photographs.size()),
                    .num_registered = static_cast<double>(poses.num_registered),
                    .reprojection_error = poses.reprojection_error}};
}

}  // namespace pepeseg
