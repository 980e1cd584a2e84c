// The method, from the files of a dataset to a model, on one page: Train() lists the stages, and
// the methods below it are the stages, in the same order.
#include "core/train/train.h"

#include <sys/resource.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/evaluate/image_scores.h"
#include "core/evaluate/lpips.h"
#include "core/features/trainer.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/reconstruct/trainer.h"
#include "core/train/early_field.h"
#include "core/train/model_writing.h"
#include "core/train/pose_stage.h"
#include "core/train/prepare_files.h"
#include "core/train/previews.h"
#include "core/train/prior_stage.h"
#include "core/train/run_stage.h"
#include "core/train/scene_warnings.h"
#include "core/train/snapshots.h"
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
  void StartPriors();
  absl::Status ReconstructScene();
  absl::Status EvaluateScene();
  absl::Status TrainFeatures();
  absl::StatusOr<TrainedModel> Index() &&;

 private:
  void Plan() { observer_.PlanStages(PlanStages(facts_, settings_)); }
  void ExpectLessOfSam();
  absl::Status ImportViews();
  absl::Status TakeGivenGaussians(const DatasetFile& file);
  absl::Status TrainGaussians();
  absl::StatusOr<Gaussians> RunStageOne();
  absl::Status CheckDevice() const;
  absl::Status WriteModelTo(const std::filesystem::path& folder);

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
  training.StartPriors();
  RETURN_IF_ERROR(training.ReconstructScene());
  RETURN_IF_ERROR(training.EvaluateScene());
  if (!training.PriorsComeFirst()) RETURN_IF_ERROR(training.MakePriors());
  RETURN_IF_ERROR(training.TrainFeatures());
  return std::move(training).Index();
}

namespace {

// Opens the LPIPS weights first, so that wrong weights are an error at once and not after an hour.
absl::Status Training::Open() {
  ASSIGN_OR_RETURN(scorer_,
                   HeldOutScorer::Create(inputs_.tools.lpips_weights, inputs_.tools.num_threads));
  Plan();
  return absl::OkStatus();
}

// Stage "prepare": verifies the files, and converts HEIC photographs and videos to JPEGs, which all
// later stages read.
absl::Status Training::Prepare() {
  RETURN_IF_ERROR(stages_.Start(Stage::kPrepare));
  RETURN_IF_ERROR(VerifyFiles(inputs_, observer_));
  RETURN_IF_ERROR(CheckGivenGaussians(inputs_.files));
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
  ASSIGN_OR_RETURN(scene_.capture,
                   ImportCapture(scene_.files, settings_.import, inputs_.tools.num_threads));
  stages_.WarnOfAll(scene_.capture.warnings);
  SetViews(scene_.capture, facts_);
  Plan();
  return absl::OkStatus();
}

// A GPU leaves the cores idle in stage one, where built-in priors are made on them meanwhile.
void Training::StartPriors() {
  if (!PriorsComeFirst() && facts_.on_device) priors_.StartEmbedding(scene_);
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
  model_ = DescribeModel(inputs_, scene_.capture, backend_);
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
  if (observer_.FirstSnapshotSeconds())
    RETURN_IF_ERROR(WriteModelTo(inputs_.folders.run / kGivenFolder));
  return stages_.EndSkipped({.num_gaussians = static_cast<double>(model_.gaussians.count)},
                            "given");
}

// Writes the result to a folder of its own until there is a model, so that a later run need not
// train again. Its checkpoints are removed only after that.
absl::Status Training::TrainGaussians() {
  std::optional<Gaussians> earlier = FindEarlierGaussians(inputs_.folders, observer_);
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

// Trains from the farthest checkpoint. SAM computes meanwhile, so that the plan is made again.
absl::StatusOr<Gaussians> Training::RunStageOne() {
  StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kReconstruct);
  ASSIGN_OR_RETURN(const auto trainer,
                   ResumeOrCreate<GaussianTrainer>(checkpoints, stages_, backend_, scene_.capture,
                                                   settings_.reconstruct));
  stages_.WarnIf(WarningOfBlurred(scene_.capture, trainer->blurred()));
  stages_.LookEveryFewSteps([this] { ExpectLessOfSam(); });
  Previews previews(scene_.capture, *trainer, observer_);
  EarlyField early(
      {scene_.capture, model_, settings_.features, inputs_.folders.run / kEarlyFolder}, *trainer,
      QueueForEarlyField(backend_, scene_.capture, settings_.reconstruct, settings_.features),
      observer_);
  ASSIGN_OR_RETURN(Gaussians gaussians,
                   RunStage(*trainer, checkpoints, stages_, [&](const StepReport& report) {
                     early.Advance(report);
                     return previews.ShowIfDue(report);
                   }));
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
  const TrainingMetrics means = MeansOf(scores);
  if (means.psnr) {
    stages_.WarnIf(WarningOfWrongPoses(settings_.reconstruct.num_steps, *means.psnr));
  }
  return stages_.EndScored(means, std::move(scores));
}

// Stage "features": trains the feature of each Gaussian and the scale gate, with the Gaussians
// fixed (METHOD.md sections 2 and 3).
absl::Status Training::TrainFeatures() {
  if (stages_.metrics().num_masks == 0) {
    observer_.Log("no masks: the model can be rendered, not segmented");
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(stages_.Start(Stage::kFeatures));
  StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kFeatures);
  ASSIGN_OR_RETURN(const auto trainer,
                   ResumeOrCreate<FeatureTrainer>(checkpoints, stages_, backend_, scene_.capture,
                                                  model_.gaussians, settings_.features));
  Snapshots snapshots(*trainer, observer_);
  ASSIGN_OR_RETURN(model_.field,
                   RunStage(*trainer, checkpoints, stages_,
                            [&](const StepReport& report) { return snapshots.TakeIfDue(report); }));
  RETURN_IF_ERROR(CheckDevice());
  return stages_.End({.mask_quality = trainer->mask_quality()});
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
  KeepEmbeddings(inputs_.folders, scene_.capture, observer_);
  RETURN_IF_ERROR(WriteModelTo(inputs_.folders.run));
  RemoveIntermediates(inputs_.folders);
  if (StageCheckpoints* checkpoints = observer_.checkpoints(Stage::kFeatures))
    checkpoints->Remove();
  RETURN_IF_ERROR(stages_.End());
  CopyFindings(stages_.metrics(), scene_.sources, model_);
  return TrainedModel{std::move(model_), scene_.sources};
}

// Returns INTERNAL with the device's error. Device errors are asynchronous and the backend keeps
// the first one, so that each stage checks it before its result is used.
absl::Status Training::CheckDevice() const {
  if (backend_.error().empty()) return absl::OkStatus();
  return absl::InternalError(
      absl::StrCat("stage ", NameOf(stages_.stage()), ": ", backend_.error()));
}

// Writes the model as far as it is known.
absl::Status Training::WriteModelTo(const std::filesystem::path& folder) {
  CopyFindings(stages_.metrics(), scene_.sources, model_);
  return pepeseg::WriteModelTo(folder, model_);
}

}  // namespace

bool MayRunPrograms(const TrainingInputs& inputs, const TrainingSettings& settings) {
  return RunsPrograms(FactsOf(inputs, settings, /*on_device=*/false), settings.priors);
}

std::vector<std::filesystem::path> FilesOf(const TrainingTools& tools) {
  std::vector<std::filesystem::path> files;
  if (!tools.lpips_weights.empty()) {
    files = {tools.lpips_weights, tools.lpips_weights.parent_path() / kOnnxLibrary};
  }
  if (!tools.sam.empty()) files.push_back(tools.sam);
  return files;
}

}  // namespace pepeseg
