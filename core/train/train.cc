// The method, from the files of a dataset to a model, on one page: Train() lists the stages, and
// the methods below it are the stages, in the same order.
#include "core/train/train.h"

#include <sys/resource.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/evaluate/image_scores.h"
#include "core/evaluate/lpips.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/reconstruct/reconstruct.h"
#include "core/train/photograph_masks.h"
#include "core/train/pose_stage.h"
#include "core/train/prepare_files.h"
#include "core/train/prior_stage.h"
#include "core/train/resumed_stages.h"
#include "core/train/stage_log.h"
#include "core/train/training_facts.h"
#include "core/train/training_inputs.h"

namespace pepeseg {
namespace {

// One training. After Open, each public method is a stage, called in the order of declaration, but
// for MakePriors. It and the stages before it add to scene_, the others to model_.
class Training {
 public:
  Training(const TrainingInputs& inputs, const TrainingSettings& settings, Backend& backend,
           TrainingObserver& observer)
      : inputs_(inputs),
        settings_(settings),
        backend_(backend),
        observer_(observer),
        facts_(FactsOf(inputs, settings, /*on_device=*/!backend.memory().is_host)),
        stages_(observer),
        priors_(inputs, settings, stages_),
        scene_{.files = inputs.files} {}

  absl::Status Open();
  absl::Status Prepare();
  absl::Status EstimatePoses();
  bool PriorsComeFirst() const { return pepeseg::PriorsComeFirst(facts_, settings_.priors); }
  absl::Status MakePriors();
  absl::Status ReconstructScene();
  absl::Status EvaluateScene();
  absl::Status TrainFeatures();
  absl::StatusOr<TrainedModel> Index() &&;

 private:
  void Plan() { observer_.PlanStages(PlanStages(facts_, settings_)); }
  void ExpectLessOfSam();
  absl::Status ImportViews();
  absl::Status CheckGivenGaussians() const;
  absl::Status TakeGivenGaussians(const DatasetFile& file);
  absl::Status TrainGaussians();
  std::optional<Gaussians> FindEarlierGaussians();
  void WarnOfWrongPoses(const TrainingMetrics& means);
  void WarnOfBlurred(const std::vector<bool>& blurred);
  absl::StatusOr<Gaussians> RunStageOne();
  absl::Status Step(const StepReport& report);
  void ResumeAt(const StageCheckpoints* checkpoints,
                TrainingMetrics::Number TrainingMetrics::*metric);
  absl::Status CheckDevice() const;
  void DescribeModel();
  void CopyFindings();
  absl::Status WriteModelTo(const std::filesystem::path& folder);
  void KeepEmbeddings();

  const TrainingInputs& inputs_;
  const TrainingSettings& settings_;
  Backend& backend_;
  TrainingObserver& observer_;
  TrainingFacts facts_;
  StageLog stages_;
  HeldOutScorer scorer_;
  PriorStage priors_;
  std::vector<SfmPhotograph> photographs_;  // where poses are not given
  TrainingScene scene_;
  Model model_;
};

}  // namespace

absl::StatusOr<TrainedModel> Train(const TrainingInputs& inputs, const TrainingSettings& settings,
                                   Backend& backend, TrainingObserver& observer) {
  Training training(inputs, settings, backend, observer);
  RETURN_IF_ERROR(training.Open());
  RETURN_IF_ERROR(training.Prepare());
  RETURN_IF_ERROR(training.EstimatePoses());
  if (training.PriorsComeFirst()) RETURN_IF_ERROR(training.MakePriors());
  RETURN_IF_ERROR(training.ReconstructScene());
  RETURN_IF_ERROR(training.EvaluateScene());
  if (!training.PriorsComeFirst()) RETURN_IF_ERROR(training.MakePriors());
  RETURN_IF_ERROR(training.TrainFeatures());
  return std::move(training).Index();
}

namespace {

// Opens the LPIPS weights first, so that wrong weights are an error at once and not after an hour.
absl::Status Training::Open() {
  ASSIGN_OR_RETURN(scorer_, HeldOutScorer::Create(inputs_.tools.lpips_weights));
  Plan();
  return absl::OkStatus();
}

// Reads given Gaussians before any stage runs, so that a bad file is an error at once.
absl::Status Training::CheckGivenGaussians() const {
  for (const DatasetFile& file : inputs_.files) {
    if (file.kind != FileKind::kGaussians) continue;
    RETURN_IF_ERROR(ReadGaussianPly(file.path, file.name).status());
  }
  return absl::OkStatus();
}

// Stage "prepare": verifies the files, and converts HEIC photographs and videos to JPEGs, which all
// later stages read.
absl::Status Training::Prepare() {
  RETURN_IF_ERROR(stages_.Start(Stage::kPrepare));
  RETURN_IF_ERROR(VerifyFiles(inputs_, observer_));
  RETURN_IF_ERROR(CheckGivenGaussians());
  RETURN_IF_ERROR(ConvertHeicPhotographs(inputs_.folders, stages_, scene_.files));
  RETURN_IF_ERROR(
      AppendVideoFrames(inputs_.folders, settings_.sfm.max_video_frames, stages_, scene_.files));
  if (!HasKind(scene_.files, FileKind::kPoses)) {
    ASSIGN_OR_RETURN(photographs_, PhotographsWithoutPoses(scene_.files, inputs_.folders));
    return stages_.End({.num_photographs = static_cast<double>(photographs_.size())});
  }
  RETURN_IF_ERROR(ImportViews());
  return stages_.End(Counts(scene_.capture));
}

// Stage "sfm": estimates poses, lenses and sparse points by structure from motion, unless poses are
// given. SAM segments photographs meanwhile and during stage one, because that needs neither.
absl::Status Training::EstimatePoses() {
  priors_.StartSam(scene_.files);
  if (HasKind(scene_.files, FileKind::kPoses)) {
    scene_.sources.poses = {Source::Kind::kGiven};
    return stages_.Skip(Stage::kSfm, "given");
  }
  RETURN_IF_ERROR(stages_.Start(Stage::kSfm));
  ASSIGN_OR_RETURN(PosesMade made, AppendPoses(inputs_, settings_.sfm, photographs_, backend_,
                                               stages_, scene_.files));
  scene_.sources.poses = {Source::Kind::kProgram, made.program};
  RETURN_IF_ERROR(ImportViews());
  made.metrics.Merge(Counts(scene_.capture));
  return stages_.End(made.metrics);
}

// Decodes the photographs once, into the views that all later stages work on. Only SAM decodes
// photographs itself, because it starts before there are views.
absl::Status Training::ImportViews() {
  ASSIGN_OR_RETURN(scene_.capture, ImportCapture(scene_.files, settings_.import));
  stages_.WarnOfAll(scene_.capture.warnings);
  SetViews(scene_.capture, facts_);
  Plan();
  return absl::OkStatus();
}

// Stage "priors": makes the masks that stage two is trained on, and the depth that losses of both
// stages use. Only depth of the operator's command has a use in stage one.
absl::Status Training::MakePriors() {
  ExpectLessOfSam();
  if (facts_.num_to_segment) {
    observer_.Log(absl::StrCat("SAM: ", *facts_.num_to_segment, " photographs are left"));
  }
  return priors_.Run(scene_);
}

// Plans again if SAM has segmented photographs since the last time, or has just started.
void Training::ExpectLessOfSam() {
  const std::optional<int64_t> left = priors_.NumToSegment(scene_.capture);
  if (left == facts_.num_to_segment) return;
  facts_.num_to_segment = left;
  Plan();
}

// Stage "reconstruct": takes the Gaussians of the dataset or trains them (METHOD.md section 1).
absl::Status Training::ReconstructScene() {
  RETURN_IF_ERROR(stages_.Start(Stage::kReconstruct));
  DescribeModel();
  // Given Gaussians are not trained, whatever the settings say.
  for (const DatasetFile& file : inputs_.files) {
    if (file.kind == FileKind::kGaussians) return TakeGivenGaussians(file);
  }
  return TrainGaussians();
}

absl::Status Training::TakeGivenGaussians(const DatasetFile& file) {
  ASSIGN_OR_RETURN(model_.gaussians, ReadGaussianPly(file.path, file.name, scene_.capture.origin));
  if (model_.gaussians.count == 0) {
    return absl::InvalidArgumentError(file.name + ": has no Gaussians");
  }
  model_.facts["gaussians"] = "given as " + file.name;
  return stages_.EndSkipped({.num_gaussians = static_cast<double>(model_.gaussians.count)},
                            "given");
}

// Writes the result to a folder of its own until there is a model, so that a later run need not
// train again. Its checkpoints are removed only after that.
absl::Status Training::TrainGaussians() {
  std::optional<Gaussians> earlier = FindEarlierGaussians();
  if (earlier) {
    model_.gaussians = *std::move(earlier);
  } else {
    ASSIGN_OR_RETURN(model_.gaussians, RunStageOne());
  }
  RETURN_IF_ERROR(WriteModelTo(inputs_.folders.run / kReconstructFolder));
  if (StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kReconstruct))
    checkpoints->Remove();
  return stages_.End({.num_gaussians = static_cast<double>(model_.gaussians.count)});
}

// Returns the Gaussians of an earlier run, which had the same files, options and seed.
std::optional<Gaussians> Training::FindEarlierGaussians() {
  for (const std::filesystem::path& run : inputs_.folders.earlier) {
    absl::StatusOr<Model> earlier = ReadModel(run / kReconstructFolder);
    if (!earlier.ok()) continue;
    observer_.Log(absl::StrCat("stage one was done by ", run.filename().string()));
    return std::move(earlier->gaussians);
  }
  return std::nullopt;
}

// Names the photographs that stage one trains on less.
void Training::WarnOfBlurred(const std::vector<bool>& blurred) {
  std::vector<std::string> names;
  size_t number = 0;  // among the training views
  for (const View& view : scene_.capture.views) {
    if (view.held_out) continue;
    if (number < blurred.size() && blurred[number]) names.push_back(view.name);
    ++number;
  }
  if (names.empty()) return;
  stages_.Warn(absl::StrCat(names.size(), " of ", number,
                            " photographs are blurred and count less: ", absl::StrJoin(names, ", "),
                            "; sharp ones of the same places make a better model"));
}

// Trains from the farthest checkpoint. Each step is followed by a report, which can cancel the
// training, and by a checkpoint when one is due.
absl::StatusOr<Gaussians> Training::RunStageOne() {
  StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kReconstruct);
  ASSIGN_OR_RETURN(
      const std::unique_ptr<Reconstructor> stage,
      StartReconstruction(checkpoints, backend_, scene_.capture, settings_.reconstruct));
  ResumeAt(checkpoints, &TrainingMetrics::resumed_from_step);
  WarnOfBlurred(stage->blurred());
  RETURN_IF_ERROR(stages_.ReportSkipped(stage->skipped()));
  absl::StatusOr<Gaussians> gaussians = [&] {
    const Polling polling(observer_);
    return FinishReconstruction(*stage, [&](const StepReport& report) {
      RETURN_IF_ERROR(stages_.ReportSkipped(stage->skipped()));
      return SaveStep(Step(report), report.step, *stage, checkpoints);
    });
  }();
  RETURN_IF_ERROR(gaussians.status());
  RETURN_IF_ERROR(CheckDevice());
  return gaussians;
}

// Stage "evaluate": renders the held-out views, which are never trained on, and compares them with
// their photographs (METHOD.md section 5).
absl::Status Training::EvaluateScene() {
  RETURN_IF_ERROR(stages_.Start(Stage::kEvaluate));
  ASSIGN_OR_RETURN(std::vector<ViewScores> scores,
                   scorer_.Score(backend_, scene_.capture, model_.gaussians,
                                 [this](const std::string& message) { stages_.Warn(message); }));
  RETURN_IF_ERROR(CheckDevice());
  RecordScores(scores, model_);
  TrainingMetrics means;
  if (!scores.empty()) {
    const ImageScores mean = Mean(scores);
    means = {.psnr = mean.psnr, .ssim = mean.ssim, .lpips = mean.lpips};
  }
  WarnOfWrongPoses(means);
  return stages_.EndScored(means, std::move(scores));
}

// Warns where the renderings have nothing in common with the photographs, which masks cannot cause.
// After a few steps they have not either.
void Training::WarnOfWrongPoses(const TrainingMetrics& means) {
  constexpr double kNothingInCommon = 12;  // dB
  constexpr int kFewSteps = 300;
  if (settings_.reconstruct.num_steps < kFewSteps) return;
  if (!means.psnr || *means.psnr >= kNothingInCommon) return;
  stages_.Warn(absl::StrFormat(
      "the held-out views are rendered at %.1f dB: the model does not show the scene. The likely "
      "cause are camera poses in another convention (axes, or the inverse), of other photographs, "
      "or that do not fit the points; masks are not the cause",
      *means.psnr));
}

// Stage "features": trains the feature of each Gaussian and the scale gate, with the Gaussians
// fixed (METHOD.md sections 2 and 3). The loop is that of RunStageOne.
absl::Status Training::TrainFeatures() {
  if (stages_.metrics().num_masks == 0) {
    observer_.Log("no masks: the model can be rendered, not segmented");
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(stages_.Start(Stage::kFeatures));
  StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kFeatures);
  ASSIGN_OR_RETURN(
      const std::unique_ptr<FeatureStage> stage,
      StartFeatures(checkpoints, backend_, scene_.capture, model_.gaussians, settings_.features));
  ResumeAt(checkpoints, &TrainingMetrics::features_resumed_from_step);
  RETURN_IF_ERROR(stages_.ReportSkipped(stage->skipped()));
  absl::StatusOr<FeatureField> field = [&] {
    const Polling polling(observer_);
    return FinishFeatures(*stage, [&](const StepReport& report) {
      RETURN_IF_ERROR(stages_.ReportSkipped(stage->skipped()));
      return SaveStep(Step(report), stage->step(), *stage, checkpoints);
    });
  }();
  RETURN_IF_ERROR(field.status());
  RETURN_IF_ERROR(CheckDevice());
  model_.field = *std::move(field);
  return stages_.End({.mask_quality = stage->mask_quality()});
}

// Stage "index": writes the model, then removes what earlier stages and runs left, because only the
// model's files are needed from here on.
absl::StatusOr<TrainedModel> Training::Index() && {
  RETURN_IF_ERROR(stages_.Start(Stage::kIndex));
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  // Linux counts ru_maxrss in KiB.
  stages_.Add({.peak_device_bytes = static_cast<double>(backend_.peak_bytes_in_use()),
               .peak_memory_bytes = static_cast<double>(usage.ru_maxrss) * 1024});
  // Written before anything is removed: a crash in between leaves too much, never too little.
  KeepEmbeddings();
  RETURN_IF_ERROR(WriteModelTo(inputs_.folders.run));
  RemoveIntermediates(inputs_.folders);
  if (StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kFeatures))
    checkpoints->Remove();
  RETURN_IF_ERROR(stages_.End());
  CopyFindings();
  return TrainedModel{std::move(model_), scene_.sources};
}

// Reports a step of stage one or two. Returns the observer's error, and INTERNAL when stage one
// exceeds the number of Gaussians that its memory was estimated for.
absl::Status Training::Step(const StepReport& report) {
  RETURN_IF_ERROR(stages_.Step(report));
  constexpr int64_t kStepsPerLook = 50;
  if (stages_.stage() == Stage::kReconstruct && report.step % kStepsPerLook == 0) ExpectLessOfSam();
  if (stages_.stage() == Stage::kReconstruct &&
      report.num_gaussians > settings_.reconstruct.max_gaussians) {
    return absl::InternalError(absl::StrCat(
        "stage ", NameOf(stages_.stage()), ", step ", report.step, ": ", report.num_gaussians,
        " Gaussians exceed max_gaussians, ", settings_.reconstruct.max_gaussians));
  }
  return absl::OkStatus();
}

// Reports and records as a metric the step that a stage resumes from; does nothing at step 0.
void Training::ResumeAt(const StageCheckpoints* checkpoints,
                        TrainingMetrics::Number TrainingMetrics::*metric) {
  const int64_t step = checkpoints == nullptr ? 0 : checkpoints->first_step();
  if (step == 0) return;
  observer_.ResumeStage(step);
  TrainingMetrics resumed;
  resumed.*metric = static_cast<double>(step);
  stages_.Add(resumed);
}

// Returns INTERNAL with the device's error. Device errors are asynchronous and the backend keeps
// the first one, so that each stage checks it before its result is used.
absl::Status Training::CheckDevice() const {
  if (backend_.error().empty()) return absl::OkStatus();
  return absl::InternalError(
      absl::StrCat("stage ", NameOf(stages_.stage()), ": ", backend_.error()));
}

// Fills in all of the model that is known before stage one.
void Training::DescribeModel() {
  for (const View& view : scene_.capture.views) {
    model_.views.push_back({.name = view.name,
                            .camera = view.camera,
                            .cam_from_world = view.cam_from_world,
                            .held_out = view.held_out,
                            .photograph = view.photograph});
  }
  model_.origin = scene_.capture.origin;
  model_.scene_radius = SceneRadius(scene_.capture);
  model_.facts = inputs_.facts;
  model_.facts["device"] = backend_.name();
}

// Copies the metrics of the stages so far, and the sources of their inputs, to the model.
void Training::CopyFindings() {
  for (const auto& [name, value] : stages_.metrics().ByName()) model_.metrics[name] = value;
  for (const auto& [what, source] : ByName(scene_.sources)) model_.facts[what] = source;
}

// Moves the embeddings of photographs to the model's folder, before its manifest is there. The
// manifest does not list them: a model is whole without them.
void Training::KeepEmbeddings() {
  const int count =
      MoveEmbeddings(SamFolder(inputs_.folders), scene_.capture.views, inputs_.folders.run);
  if (count == 0) return;
  observer_.Log(
      absl::StrFormat("SAM: the embeddings of %d photographs are kept with the model: "
                      "%.0f MB",
                      count, 1e-6 * static_cast<double>(count * kEmbeddingFileBytes)));
}

absl::Status Training::WriteModelTo(const std::filesystem::path& folder) {
  CopyFindings();
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  return WriteModel(folder, model_);
}

}  // namespace

}  // namespace pepeseg
