#include "core/train/prior_stage.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_index.h"

namespace pepeseg {
namespace {

bool MayUseCommand(PriorMaker maker) {
  return maker == PriorMaker::kAuto || maker == PriorMaker::kCommand;
}

// Returns true if the dataset's masks are used. Those of transforms.json (mask_path) say what to
// ignore and give no masks.
bool UsesGivenMasks(const TrainingScene& scene, const ImportOptions& options) {
  return options.use_masks && HasKind(scene.files, FileKind::kMask) &&
         std::ranges::any_of(scene.capture.views,
                             [](const View& view) { return !view.masks.empty(); });
}

bool UsesGivenDepth(const TrainingScene& scene, const ImportOptions& options) {
  return options.use_depth &&
         (HasKind(scene.files, FileKind::kDepth) || HasKind(scene.files, FileKind::kDisparity));
}

// Returns a warning that an option, which says what makes priors, has no effect on given ones.
std::string WarningOfGiven(absl::string_view what) {
  return absl::StrCat("priors.", what, " says what makes ", what,
                      " where a dataset has none. This ", "one has ", what,
                      ", which is used; import.use_", what, "=false leaves it out");
}

// Returns the photographs of the views, in the views' order, which is that of their names.
std::vector<DatasetFile> PosedPhotographs(const TrainingScene& scene) {
  std::map<std::string, const DatasetFile*> by_key;
  for (const DatasetFile& file : scene.files) {
    if (file.kind == FileKind::kImage) by_key[PhotoKey(file.name)] = &file;
  }
  std::vector<DatasetFile> photographs;
  photographs.reserve(scene.capture.views.size());
  for (const View& view : scene.capture.views) {
    const auto found = by_key.find(view.name);
    if (found != by_key.end()) photographs.push_back(*found->second);
  }
  return photographs;
}

}  // namespace

bool PriorStage::MayUseSam() const {
  const PriorMaker maker = settings_.priors.masks;
  return !inputs_.tools.sam.empty() && (maker == PriorMaker::kAuto || AsksForSam(maker));
}

void PriorStage::StartSam(const std::vector<DatasetFile>& files) {
  const bool given = settings_.import.use_masks && HasKind(files, FileKind::kMask);
  const bool expected =
      ExpectsSam(settings_.priors.masks, HasCommand(), !inputs_.tools.sam.empty());
  if (given || !expected || segmentation_) return;
  segmentation_.emplace(inputs_, settings_.import, files, /*next_to_other_stages=*/true);
}

std::optional<int64_t> PriorStage::NumToSegment(const Capture& capture) const {
  return segmentation_ ? std::optional(segmentation_->NumLeft(capture)) : std::nullopt;
}

void PriorStage::StartEmbedding(const TrainingScene& scene) {
  if (HasCommand() || MayUseSam()) return;
  const EmbeddedPriors what = Embedded(Asked(scene));
  if (!what.masks && !what.depth) return;
  // One core is left to the thread that keeps the device busy.
  embedding_.emplace(what, std::max(1, NumThreads(inputs_.tools.num_threads) - 1), scene.capture);
}

// Returns what is to be made. Uploaded priors always win: only what the dataset lacks is made.
PriorWants PriorStage::Asked(const TrainingScene& scene) const {
  const PriorMaker depth = settings_.priors.depth;
  const bool masks =
      !UsesGivenMasks(scene, settings_.import) && settings_.priors.masks != PriorMaker::kNone;
  const bool depth_has_use = depth != PriorMaker::kAuto || HasCommand() || masks;
  return {masks,
          !UsesGivenDepth(scene, settings_.import) && depth != PriorMaker::kNone && depth_has_use};
}

// Returns what the built-in methods make of what no command has made. SAM's masks replace built-in
// ones, which are made only to be joined with them, or if SAM fails.
EmbeddedPriors PriorStage::Embedded(PriorWants wants) const {
  const PriorMaker masks = settings_.priors.masks, depth = settings_.priors.depth;
  const bool embedded = wants.masks && masks != PriorMaker::kCommand &&
                        (!MayUseSam() || masks == PriorMaker::kSamAndEmbedded);
  return {embedded, wants.depth && depth != PriorMaker::kCommand &&
                        (embedded || depth == PriorMaker::kEmbedded)};
}

absl::Status PriorStage::Run(TrainingScene& scene) {
  const bool has_masks = UsesGivenMasks(scene, settings_.import);
  const bool has_depth = UsesGivenDepth(scene, settings_.import);
  const PriorWants asked = Asked(scene);
  if (has_masks && settings_.priors.masks != PriorMaker::kAuto) {
    stages_.Warn(WarningOfGiven("masks"));
  }
  if (has_depth && settings_.priors.depth != PriorMaker::kAuto) {
    stages_.Warn(WarningOfGiven("depth"));
  }
  scene.sources.masks = {has_masks ? Source::Kind::kGiven : Source::Kind::kNone};
  scene.sources.depth = {has_depth ? Source::Kind::kGiven : Source::Kind::kNone};
  if (!asked.any()) return stages_.Skip(Stage::kPriors, has_masks ? "given" : "left out");
  RETURN_IF_ERROR(stages_.Start(Stage::kPriors));
  RETURN_IF_ERROR(MakeByCommand(asked, scene));
  RETURN_IF_ERROR(MakeOthers(asked, scene));
  const TrainingMetrics counts = Counts(scene.capture);
  return stages_.End({.num_masks = counts.num_masks, .num_depth_maps = counts.num_depth_maps});
}

// Runs the command if it may or must make something. If it need not succeed, its failure is a
// warning and the sources stay kNone, so that MakeOthers takes over.
absl::Status PriorStage::MakeByCommand(PriorWants asked, TrainingScene& scene) {
  const PriorOptions& options = settings_.priors;
  const PriorWants wants = {asked.masks && MayUseCommand(options.masks),
                            asked.depth && MayUseCommand(options.depth)};
  const bool required = (wants.masks && options.masks == PriorMaker::kCommand) ||
                        (wants.depth && options.depth == PriorMaker::kCommand);
  if (!wants.any() || (!HasCommand() && !required)) return absl::OkStatus();
  if (!HasCommand()) {
    return absl::FailedPreconditionError(
        "masks or depth are to be made by a priors command, and this server no longer has one: its "
        "operator sets it by pepesegd --priors-command");
  }
  absl::Status status = TakeFromCommand(wants, scene);
  if (status.ok() || required || absl::IsCancelled(status)) return status;
  stages_.Warn(std::string(status.message()));
  return absl::OkStatus();
}

// Runs the command and imports the files that it made, as if they had been uploaded. On an error
// the scene stays as it was.
absl::Status PriorStage::TakeFromCommand(PriorWants wants, TrainingScene& scene) {
  ASSIGN_OR_RETURN(const std::vector<DatasetFile> made,
                   RunPriorsCommand(inputs_, PosedPhotographs(scene), wants, stages_));
  const absl::StatusOr<std::vector<std::string>> warnings =
      ImportPriors(made, scene.capture, inputs_.tools.num_threads);
  if (!warnings.ok()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the priors ", SourceOfCommand(inputs_.tools.priors_command),
                     " made files that cannot be used: ", warnings.status().message()));
  }
  stages_.WarnOfAll(*warnings);
  scene.files.insert(scene.files.end(), made.begin(), made.end());
  if (wants.masks) RETURN_IF_ERROR(RecordMade(made, /*masks=*/true, scene));
  if (wants.depth) RETURN_IF_ERROR(RecordMade(made, /*masks=*/false, scene));
  return absl::OkStatus();
}

// Records the command as the source of the masks, or else of the depth, if it has made any. Warns
// where it has not made them for every photograph.
absl::Status PriorStage::RecordMade(const std::vector<DatasetFile>& made, bool masks,
                                    TrainingScene& scene) {
  const char* what = masks ? "masks" : "depth";
  const PriorMaker maker = masks ? settings_.priors.masks : settings_.priors.depth;
  const std::string source = SourceOfCommand(inputs_.tools.priors_command);
  const auto count =
      static_cast<size_t>(std::count_if(made.begin(), made.end(), [masks](const DatasetFile& file) {
        return masks == (file.kind == FileKind::kMask);
      }));
  const size_t num_views = scene.capture.views.size();
  if (count > 0) {
    (masks ? scene.sources.masks : scene.sources.depth) = {Source::Kind::kProgram, source};
  }
  if (count == num_views) return absl::OkStatus();
  const std::string message = absl::StrCat("the priors ", source, " made ", what, " for ", count,
                                           " of ", num_views, " photographs");
  if (count == 0 && maker == PriorMaker::kCommand) return absl::FailedPreconditionError(message);
  stages_.Warn(message);
  return absl::OkStatus();
}

// Makes what the command did not: depth by the built-in method, masks by SAM, the built-in method,
// or both.
absl::Status PriorStage::MakeOthers(PriorWants asked, TrainingScene& scene) {
  const PriorMaker maker = settings_.priors.masks;
  const PriorWants wants = {asked.masks && scene.sources.masks.none(),
                            asked.depth && scene.sources.depth.none()};
  const bool masks = wants.masks && maker != PriorMaker::kCommand;
  const bool by_sam = masks && MayUseSam();
  if (masks && inputs_.tools.sam.empty() && AsksForSam(maker)) {
    stages_.Warn("SAM: this server no longer has it. The job continues with the built-in masks.");
  }
  if (by_sam && !segmentation_) {
    segmentation_.emplace(inputs_, settings_.import, scene.files, /*next_to_other_stages=*/false);
  }
  RETURN_IF_ERROR(Embed(Embedded(wants), by_sam ? kShareBeforeSam : 1, scene));
  if (!masks) return absl::OkStatus();
  if (by_sam) RETURN_IF_ERROR(TakeMasksOfSam(scene));
  Source& source = scene.sources.masks;
  if (source.none() && Counts(scene.capture).num_masks > 0) source = {Source::Kind::kEmbedded};
  if (!source.none()) stages_.observer().MadeMasks(source);
  return absl::OkStatus();
}

// Makes built-in masks or depth. share: the part of the stage's work that this is, for the
// progress.
absl::Status PriorStage::Embed(EmbeddedPriors what, double share, TrainingScene& scene) {
  if (!what.masks && !what.depth) return absl::OkStatus();
  if (!embedding_) embedding_.emplace(what, inputs_.tools.num_threads, scene.capture);
  const auto report = [&](int done, int num_views) {
    StepReport step = {.step = done,
                       .num_steps = num_views,
                       .activity = MakingActivity(what.masks, what.depth),
                       .unit = "photographs"};
    if (share < 1) step.share = share * done / num_views;
    return stages_.StepIfNew(step);
  };
  const absl::Status status = embedding_->Finish(report, scene.capture);
  embedding_.reset();
  RETURN_IF_ERROR(status);
  if (what.depth && Counts(scene.capture).num_depth_maps > 0) {
    scene.sources.depth = {Source::Kind::kEmbedded};
  }
  return absl::OkStatus();
}

// Waits for SAM's masks and gives them to the views. If SAM fails, warns and makes built-in masks.
absl::Status PriorStage::TakeMasksOfSam(TrainingScene& scene) {
  const bool join = settings_.priors.masks == PriorMaker::kSamAndEmbedded;
  const absl::Status status = segmentation_->GiveMasks(stages_, join, scene.capture);
  segmentation_.reset();
  if (absl::IsCancelled(status)) return status;
  if (status.ok()) {
    scene.sources.masks = {join ? Source::Kind::kSamAndEmbedded : Source::Kind::kSam};
    return absl::OkStatus();
  }
  stages_.Warn(absl::StrCat(status.message(), ". The job continues with the built-in masks."));
  const bool depth = settings_.priors.depth == PriorMaker::kAuto && scene.sources.depth.none();
  return Embed({.masks = true, .depth = depth}, 1, scene);
}

}  // namespace pepeseg
