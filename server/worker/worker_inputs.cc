#include "server/worker/worker_inputs.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_index.h"
#include "core/priors/embed_priors.h"
#include "server/api/mask_advice.h"
#include "server/worker/worker_heic.h"
#include "server/worker/worker_plan.h"
#include "server/worker/worker_priors_command.h"
#include "server/worker/worker_sam.h"
#include "server/worker/worker_sfm.h"
#include "server/worker/worker_verify.h"

namespace pepeseg {
namespace {

bool HasKind(std::span<const DatasetFile> files, FileKind kind) {
  return std::any_of(files.begin(), files.end(),
                     [kind](const DatasetFile& file) { return file.kind == kind; });
}

bool ByCommand(PriorMaker maker) {
  return maker == PriorMaker::kAuto || maker == PriorMaker::kCommand;
}

// The files of a dataset, and what is made of them where they are not all that a training needs.
class InputStages {
 public:
  InputStages(const WorkerJob& job, const TrainingSettings& settings, StageLog& stages)
      : job_(job), settings_(settings), stages_(stages), facts_(FactsOf(job, settings)) {
    stages_.Plan(PlanStages(facts_, settings_));
  }

  absl::Status Prepare();
  absl::Status EstimatePoses();
  absl::Status MakePriors();
  SceneInputs Take() && { return std::move(inputs_); }

 private:
  absl::Status ListFiles();
  absl::Status Import();
  std::vector<DatasetFile> PosedPhotos() const;
  absl::Status MakePriorsByCommand(PriorWants asked);
  absl::Status TakeFromCommand(PriorWants wants);
  absl::Status MakeOtherPriors(PriorWants asked);
  absl::Status Embed(EmbeddedPriors what, double share);
  absl::Status TakeMasksOfSam();
  absl::Status NoteMade(const std::vector<DatasetFile>& made, const char* what, PriorMaker maker);
  std::map<std::string, double> Counts() const;

  const WorkerJob& job_;
  const TrainingSettings& settings_;
  StageLog& stages_;
  std::vector<DatasetFile> files_;
  JobFacts facts_;
  std::set<std::string> told_;              // warnings of the import
  std::vector<SfmPhotograph> photographs_;  // where poses are not given
  SceneInputs inputs_;
  std::optional<PhotographSegmentation> segmentation_;  // absent: SAM is not asked, or not yet
};

absl::Status InputStages::ListFiles() {
  for (const JobSpecFile& file : job_.spec.files) {
    ASSIGN_OR_RETURN(const FileKind kind, FileKindFromProto(static_cast<v1::FileKind>(file.kind)));
    files_.push_back({kind, file.name, file.path});
    if (kind == FileKind::kGaussians) inputs_.gaussians = files_.back();
  }
  return absl::OkStatus();
}

// Again, when there are more files: what was read before is freed first.
absl::Status InputStages::Import() {
  inputs_.capture = Capture();
  ASSIGN_OR_RETURN(inputs_.capture, ImportCapture(files_, settings_.import));
  SetViews(inputs_.capture, facts_);
  stages_.Plan(PlanStages(facts_, settings_));
  std::vector<std::string> news;
  for (const std::string& warning : inputs_.capture.warnings) {
    if (told_.insert(warning).second) news.push_back(warning);
  }
  stages_.WarnOf(news);
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
  RETURN_IF_ERROR(VerifyInputs(job_.spec, job_.damaged_inputs));
  RETURN_IF_ERROR(ListFiles());
  RETURN_IF_ERROR(ConvertHeicPhotographs(job_, stages_, files_));
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
  // What the command is expected to make is not made twice.
  const bool by_command = settings_.priors.masks == PriorMaker::kAuto && facts_.has_priors_command;
  if (!facts_.has_masks && !by_command && UsesSam(job_, settings_.priors.masks)) {
    segmentation_.emplace(job_, settings_.import, files_, /*poses_are_wanted=*/true);
  }
  RETURN_IF_ERROR(stages_.Start("sfm"));
  ASSIGN_OR_RETURN(PosesMade made, AppendPoses(job_, settings_.sfm, stages_, photographs_, files_));
  inputs_.sources["poses"] = made.source;
  RETURN_IF_ERROR(Import());
  made.metrics.merge(Counts());
  return stages_.End(made.metrics);
}

// In the views' order, that of their names.
std::vector<DatasetFile> InputStages::PosedPhotos() const {
  std::map<std::string, const DatasetFile*> by_key;
  for (const DatasetFile& file : files_) {
    if (file.kind == FileKind::kImage) by_key[PhotoKey(file.name)] = &file;
  }
  std::vector<DatasetFile> photos;
  photos.reserve(inputs_.capture.views.size());
  for (const View& view : inputs_.capture.views) {
    const auto photo = by_key.find(view.name);
    if (photo != by_key.end()) photos.push_back(*photo->second);
  }
  return photos;
}

absl::Status InputStages::NoteMade(const std::vector<DatasetFile>& made, const char* what,
                                   PriorMaker maker) {
  const bool masks = what == std::string("masks");
  const auto count =
      static_cast<size_t>(std::count_if(made.begin(), made.end(), [masks](const DatasetFile& file) {
        return masks == (file.kind == FileKind::kMask);
      }));
  const size_t num_views = inputs_.capture.views.size();
  if (count > 0) inputs_.sources[what] = SourceOfCommand(job_);
  if (count == num_views) return absl::OkStatus();
  const std::string message = absl::StrCat("the priors ", SourceOfCommand(job_), " made ", what,
                                           " for ", count, " of ", num_views, " photographs");
  if (count == 0 && maker == PriorMaker::kCommand) return absl::FailedPreconditionError(message);
  stages_.Warn(message);
  return absl::OkStatus();
}

// Runs the command, and imports what it made as if it had been uploaded.
absl::Status InputStages::TakeFromCommand(PriorWants wants) {
  ASSIGN_OR_RETURN(const std::vector<DatasetFile> made,
                   RunPriorsCommand(job_, PosedPhotos(), wants, stages_));
  const auto num_given = static_cast<ptrdiff_t>(files_.size());
  files_.insert(files_.end(), made.begin(), made.end());
  const absl::Status imported = Import();
  if (!imported.ok()) {
    files_.erase(files_.begin() + num_given, files_.end());
    RETURN_IF_ERROR(Import());
    return absl::FailedPreconditionError(absl::StrCat(
        "the priors ", SourceOfCommand(job_), " made what cannot be used: ", imported.message()));
  }
  if (wants.masks) RETURN_IF_ERROR(NoteMade(made, "masks", settings_.priors.masks));
  if (wants.depth) RETURN_IF_ERROR(NoteMade(made, "depth", settings_.priors.depth));
  return absl::OkStatus();
}

// Where the command need not succeed, what it does not make stays "none" in the sources.
absl::Status InputStages::MakePriorsByCommand(PriorWants asked) {
  const PriorOptions& options = settings_.priors;
  const PriorWants wants = {asked.masks && ByCommand(options.masks),
                            asked.depth && ByCommand(options.depth)};
  const bool required = (wants.masks && options.masks == PriorMaker::kCommand) ||
                        (wants.depth && options.depth == PriorMaker::kCommand);
  if (!wants.any() || (job_.priors.program.empty() && !required)) return absl::OkStatus();
  if (job_.priors.program.empty()) {
    return absl::FailedPreconditionError(
        "masks or depth are to be made by a priors command, and this server has none any more: its "
        "operator sets it by pepesegd --priors-command");
  }
  absl::Status status = TakeFromCommand(wants);
  if (status.ok() || required || absl::IsCancelled(status)) return status;
  stages_.Warn(std::string(status.message()));
  return absl::OkStatus();
}

// What the command did not make.
absl::Status InputStages::MakeOtherPriors(PriorWants asked) {
  const auto wants = [this](bool asked_for, const char* what, PriorMaker maker) {
    return asked_for && maker != PriorMaker::kCommand && inputs_.sources[what] == "none";
  };
  const PriorMaker maker = settings_.priors.masks;
  const bool masks = wants(asked.masks, "masks", maker);
  const bool depth = wants(asked.depth, "depth", settings_.priors.depth);
  const bool by_sam = masks && UsesSam(job_, maker);
  if (masks && job_.sam.empty() && AsksForSam(maker)) {
    stages_.Warn("SAM: this server has none any more. The job goes on with the built-in masks.");
  }
  if (by_sam && !segmentation_) {
    segmentation_.emplace(job_, settings_.import, files_, /*poses_are_wanted=*/false);
  }
  // SAM's masks replace embedded ones: those are made to be joined with them, or where SAM fails.
  const bool embedded = masks && (!by_sam || maker == PriorMaker::kSamAndEmbedded);
  RETURN_IF_ERROR(Embed({embedded, depth}, by_sam ? kShareBeforeSam : 1));
  if (depth && Counts().at("num_depth_maps") > 0) inputs_.sources["depth"] = "embedded";
  if (!masks) return absl::OkStatus();
  if (by_sam) RETURN_IF_ERROR(TakeMasksOfSam());
  if (inputs_.sources["masks"] == "none" && Counts().at("num_masks") > 0) {
    inputs_.sources["masks"] = "embedded";
  }
  if (inputs_.sources["masks"] != "none") {
    for (const std::string& advice : AdviceOnModel(inputs_.sources)) stages_.Warn(advice);
  }
  return absl::OkStatus();
}

// `share`: of the stage's work, that this is.
absl::Status InputStages::Embed(EmbeddedPriors what, double share) {
  if (!what.masks && !what.depth) return absl::OkStatus();
  return EmbedPriors(what, job_.spec.num_threads, inputs_.capture, [&](int done, int num_views) {
    StepReport report = {.stage = "priors",
                         .step = done,
                         .num_steps = num_views,
                         .activity = MakingActivity(what.masks, what.depth),
                         .unit = "photographs"};
    if (share < 1) report.share = share * done / num_views;
    return stages_.Step(report);
  });
}

// Where SAM fails, masks are embedded ones.
absl::Status InputStages::TakeMasksOfSam() {
  const bool join = settings_.priors.masks == PriorMaker::kSamAndEmbedded;
  const absl::Status status = segmentation_->GiveMasks(stages_, join, inputs_.capture);
  segmentation_.reset();
  if (absl::IsCancelled(status)) return status;
  if (status.ok()) {
    inputs_.sources["masks"] = join ? "sam and embedded" : "sam";
    return absl::OkStatus();
  }
  stages_.Warn(absl::StrCat(status.message(), ". The job goes on with the built-in masks."));
  return Embed({.masks = true}, 1);
}

absl::Status InputStages::MakePriors() {
  const bool has_masks = HasKind(files_, FileKind::kMask);
  const bool has_depth = HasKind(files_, FileKind::kDepth) || HasKind(files_, FileKind::kDisparity);
  inputs_.sources["masks"] = has_masks ? "given" : "none";
  inputs_.sources["depth"] = has_depth ? "given" : "none";
  if (has_masks && has_depth) return stages_.Skip("priors", "given");
  const PriorWants asked = {!has_masks && settings_.priors.masks != PriorMaker::kNone,
                            !has_depth && settings_.priors.depth != PriorMaker::kNone};
  if (!asked.any()) return stages_.Skip("priors", "left out");
  if (segmentation_) {
    facts_.num_to_segment = segmentation_->NumLeft(inputs_.capture);
    spdlog::info("SAM: {} photographs are left when their poses are known", *facts_.num_to_segment);
    stages_.Plan(PlanStages(facts_, settings_));
  }
  RETURN_IF_ERROR(stages_.Start("priors"));
  RETURN_IF_ERROR(MakePriorsByCommand(asked));
  RETURN_IF_ERROR(MakeOtherPriors(asked));
  const std::map<std::string, double> counts = Counts();
  return stages_.End(
      {{"num_masks", counts.at("num_masks")}, {"num_depth_maps", counts.at("num_depth_maps")}});
}

}  // namespace

bool RunsPrograms(const JobSpec& spec, const PriorsCommand& priors) {
  const auto has = [&spec](v1::FileKind kind) {
    return std::any_of(spec.files.begin(), spec.files.end(),
                       [kind](const JobSpecFile& file) { return file.kind == kind; });
  };
  if (!has(v1::FILE_KIND_POSES)) return true;
  const absl::StatusOr<TrainingSettings> settings = TrainingSettingsFromProto(spec.options);
  if (priors.program.empty() || !settings.ok()) return false;
  const bool has_depth = has(v1::FILE_KIND_DEPTH) || has(v1::FILE_KIND_DISPARITY);
  return (!has(v1::FILE_KIND_MASK) && ByCommand(settings->priors.masks)) ||
         (!has_depth && ByCommand(settings->priors.depth));
}

absl::StatusOr<SceneInputs> MakeSceneInputs(const WorkerJob& job, const TrainingSettings& settings,
                                            StageLog& stages) {
  InputStages inputs(job, settings, stages);
  RETURN_IF_ERROR(inputs.Prepare());
  RETURN_IF_ERROR(inputs.EstimatePoses());
  RETURN_IF_ERROR(inputs.MakePriors());
  return std::move(inputs).Take();
}

}  // namespace pepeseg
