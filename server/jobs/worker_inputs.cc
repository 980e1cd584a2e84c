#include "server/jobs/worker_inputs.h"

#include <algorithm>
#include <utility>

#include "core/status_macros.h"
#include "server/jobs/worker_sfm.h"

namespace pepeseg {
namespace {

bool HasKind(std::span<const DatasetFile> files, FileKind kind) {
  return std::any_of(files.begin(), files.end(),
                     [kind](const DatasetFile& file) { return file.kind == kind; });
}

// The files of a dataset, and what is made of them where they are not all that a training needs.
class InputStages {
 public:
  InputStages(const WorkerJob& job, const TrainingSettings& settings, StageLog& stages)
      : job_(job), settings_(settings), stages_(stages) {}

  absl::Status Prepare();
  absl::Status EstimatePoses();
  absl::Status MakePriors();
  SceneInputs Take() && { return std::move(inputs_); }

 private:
  absl::Status ListFiles();
  absl::Status Import();
  std::map<std::string, double> Counts() const;

  const WorkerJob& job_;
  const TrainingSettings& settings_;
  StageLog& stages_;
  std::vector<DatasetFile> files_;
  std::vector<SfmPhotograph> photographs_;  // where poses are not given
  SceneInputs inputs_;
};

absl::Status InputStages::ListFiles() {
  for (const JobSpecFile& file : job_.spec.files) {
    ASSIGN_OR_RETURN(const FileKind kind, FileKindFromProto(static_cast<v1::FileKind>(file.kind)));
    files_.push_back({kind, file.name, file.path});
    if (kind == FileKind::kGaussians) inputs_.gaussians = files_.back();
  }
  return absl::OkStatus();
}

absl::Status InputStages::Import() {
  ASSIGN_OR_RETURN(inputs_.capture, ImportCapture(files_, settings_.import));
  stages_.WarnOf(inputs_.capture.warnings);
  return absl::OkStatus();
}

std::map<std::string, double> InputStages::Counts() const {
  double num_masks = 0, num_depth_maps = 0;
  for (const View& view : inputs_.capture.views) {
    num_masks += view.masks.num_masks;
    num_depth_maps += view.depth.values.empty() ? 0 : 1;
  }
  return {{"num_views", static_cast<double>(inputs_.capture.views.size())},
          {"num_points", static_cast<double>(inputs_.capture.points.size())},
          {"num_masks", num_masks},
          {"num_depth_maps", num_depth_maps}};
}

absl::Status InputStages::Prepare() {
  RETURN_IF_ERROR(stages_.Start("prepare"));
  RETURN_IF_ERROR(ListFiles());
  RETURN_IF_ERROR(AppendVideoFrames(job_, settings_.sfm, stages_, files_));
  if (!HasKind(files_, FileKind::kPoses)) {
    ASSIGN_OR_RETURN(photographs_, PhotographsWithoutPoses(job_, files_));
    return stages_.End({{"num_photographs", static_cast<double>(photographs_.size())}});
  }
  RETURN_IF_ERROR(Import());
  return stages_.End(Counts());
}

absl::Status InputStages::EstimatePoses() {
  if (HasKind(files_, FileKind::kPoses)) {
    inputs_.sources["poses"] = "given";
    return stages_.Skip("sfm", "given");
  }
  RETURN_IF_ERROR(stages_.Start("sfm"));
  ASSIGN_OR_RETURN(PosesMade made, AppendPoses(job_, settings_.sfm, stages_, photographs_, files_));
  inputs_.sources["poses"] = made.source;
  RETURN_IF_ERROR(Import());
  made.metrics.merge(Counts());
  return stages_.End(made.metrics);
}

absl::Status InputStages::MakePriors() {
  for (const auto& [what, given] :
       {std::pair{"masks", HasKind(files_, FileKind::kMask)},
        {"depth", HasKind(files_, FileKind::kDepth) || HasKind(files_, FileKind::kDisparity)}}) {
    inputs_.sources[what] = given ? "given" : "none";
  }
  return stages_.Skip("priors", "given");
}

}  // namespace

absl::StatusOr<SceneInputs> MakeSceneInputs(const WorkerJob& job, const TrainingSettings& settings,
                                            StageLog& stages) {
  InputStages inputs(job, settings, stages);
  RETURN_IF_ERROR(inputs.Prepare());
  RETURN_IF_ERROR(inputs.EstimatePoses());
  RETURN_IF_ERROR(inputs.MakePriors());
  return std::move(inputs).Take();
}

}  // namespace pepeseg
