#include "core/train/settings/stage_plan.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

#include "core/dataset/import.h"
#include "core/dataset/video_frames.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/reconstruct/few_visits.h"
#include "core/reconstruct/step_queue.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {
namespace {

// Core seconds: kPrepare for each photograph, the others for each megapixel of the views.
constexpr double kPrepare = 0.05, kEmbeddedMasks = 1.0, kEmbeddedDepth = 1.5, kScores = 0.5,
                 kLpips = 10;
// Seconds of a step, shared by those that a GPU does at once, and further seconds for each
// megapixel of the view and for each million of Gaussians at the end, which take no time of their
// own on the cores. On the cores: seconds of one core. Fitted to runs of
// tests/bench/results/estimates.md.
struct StepCost {
  double step, megapixel, million;
};
constexpr StepCost kReconstructOnCores{0.001, 0.25, 0}, kReconstructOnDevice{0.0011, 0.0003, 0.001};
constexpr StepCost kFeaturesOnCores{0.02, 0, 0}, kFeaturesOnDevice{0.0002, 0, 0.00027};
// Seconds before the first step of stage two, and further seconds for each megapixel of the views;
// on the cores: of one core.
struct SetupCost {
  double seconds, megapixel;
};
constexpr SetupCost kFeatureSetupOnCores{0, 1.8}, kFeatureSetupOnDevice{0.2, 0.0155};
constexpr double kIndex = 0.3;
// Seconds from a job's start to its first stage: of the process, and of CUDA.
constexpr double kStart = 0.4;

// Returns true if the priors command is expected to make the masks or depth of this maker.
bool ByCommand(PriorMaker maker, const TrainingFacts& facts) {
  return maker == PriorMaker::kCommand || (maker == PriorMaker::kAuto && facts.has_priors_command);
}

// What stage "priors" is expected to make, and by which means.
struct ExpectedPriors {
  bool by_command = false;  // masks or depth
  bool by_sam = false;
  bool built_in_masks = false, built_in_depth = false;
  bool any() const { return by_command || by_sam || built_in_masks || built_in_depth; }
};

ExpectedPriors Expect(const TrainingFacts& facts, const PriorOptions& priors) {
  ExpectedPriors expected;
  if (!facts.has_masks && priors.masks != PriorMaker::kNone) {
    expected.by_command = ByCommand(priors.masks, facts);
    expected.by_sam = ExpectsSam(priors.masks, facts.has_priors_command, facts.has_sam);
    expected.built_in_masks = !expected.by_command && !expected.by_sam;
  }
  if (!facts.has_depth && priors.depth != PriorMaker::kNone) {
    const bool by_command = ByCommand(priors.depth, facts);
    expected.by_command |= by_command;
    expected.built_in_depth =
        !by_command && (priors.depth == PriorMaker::kEmbedded || expected.built_in_masks);
  }
  return expected;
}

// Lists the stages in the order in which Train runs them.
class Planner {
 public:
  Planner(const TrainingFacts& facts, const TrainingSettings& settings)
      : facts_(facts), settings_(settings), photos_(static_cast<double>(facts.num_photographs)) {}

  std::vector<PlannedStage> Plan() {
    AddOnCores(Stage::kPrepare, kPrepare * photos_ + kVideoCoreSeconds * facts_.video_megapixels);
    *stages_.back().seconds += kStart;
    if (!facts_.has_poses) AddPoses();
    const bool priors_first = PriorsComeFirst(facts_, settings_.priors);
    if (priors_first) AddPriors();
    if (!facts_.has_gaussians) AddReconstruction();
    AddScores();
    if (!priors_first) AddPriors();
    if (facts_.has_masks || settings_.priors.masks != PriorMaker::kNone) AddFeatures();
    AddOnCores(Stage::kIndex, kIndex);
    return std::move(stages_);
  }

 private:
  double Threads() const { return std::max(1, facts_.num_threads); }
  void AddOnCores(Stage stage, double core_seconds) {
    stages_.push_back({.stage = stage, .seconds = core_seconds / Threads()});
  }
  void AddSteps(Stage stage, std::vector<PlannedStage::Piece> pieces) {
    double seconds = 0;
    for (PlannedStage::Piece& piece : pieces) {
      if (!facts_.on_device) piece.seconds_per_step /= Threads();
      seconds += static_cast<double>(piece.num_steps) * piece.seconds_per_step;
    }
    stages_.push_back({stage, seconds, facts_.on_device, std::move(pieces)});
  }

  void AddPoses() {
    const SfmLoad load{.num_photographs = facts_.num_photographs,
                       .megapixels = facts_.photo_megapixels,
                       .in_sequence = facts_.is_video,
                       .on_device = facts_.on_device};
    const SfmWork work = ExpectedSfmWork(load, settings_.sfm);
    stages_.push_back({.stage = Stage::kSfm,
                       .seconds = (work.sum() - work.mapping) / Threads() +
                                  work.mapping / std::min(Threads(), work.mapping_threads)});
  }

  void AddPriors() {
    const ExpectedPriors expected = Expect(facts_, settings_.priors);
    if (!expected.any()) return;
    const double sam = SecondsOfSam(expected), built_in = SecondsOfBuiltIn(expected);
    stages_.push_back({.stage = Stage::kPriors, .seconds = sam + built_in});
    // The speed of the operator's program is unknown.
    if (expected.by_command) stages_.back().seconds.reset();
  }

  // Returns the time of the stages planned so far, but those in `without`, if a GPU computes them:
  // they leave the cores to work on masks.
  double Meanwhile(std::initializer_list<Stage> without) const {
    double seconds = 0;
    for (const PlannedStage& stage : stages_) {
      const bool counts = std::ranges::find(without, stage.stage) == without.end();
      if (facts_.on_device && counts) seconds += stage.seconds.value_or(0);
    }
    return seconds;
  }

  // Returns the time that the built-in methods need when the stage starts. They begin with stage
  // one.
  double SecondsOfBuiltIn(const ExpectedPriors& expected) const {
    const double pixels = photos_ * facts_.megapixels;
    const double seconds = pixels *
                           ((expected.built_in_masks ? kEmbeddedMasks : 0) +
                            (expected.built_in_depth ? kEmbeddedDepth : 0)) /
                           Threads();
    return std::max(0.0, seconds - Meanwhile({Stage::kPrepare, Stage::kSfm}));
  }

  // What SAM has still to do when its stage starts. Before that it has what other stages leave of
  // the processor that computes it: the cores while a GPU computes stage one, a GPU at any time
  // after the preparation.
  double SecondsOfSam(const ExpectedPriors& expected) const {
    if (!expected.by_sam) return 0;
    const double photograph = SamSeconds(std::max(1, facts_.num_threads), facts_.on_device);
    if (facts_.num_to_segment) return static_cast<double>(*facts_.num_to_segment) * photograph;
    return std::max(0.0, photos_ * photograph - Meanwhile({Stage::kPrepare}));
  }

  // The first steps train on photographs at a quarter, then at half of their width and height: see
  // ReconstructOptions::coarse_until.
  void AddReconstruction() {
    const ReconstructOptions options = FittedReconstruct();
    const StepCost cost = facts_.on_device ? kReconstructOnDevice : kReconstructOnCores;
    const auto coarse = static_cast<int64_t>(options.coarse_until * options.num_steps);
    const double gaussians = cost.million * MillionGaussians(options);
    const int num_branches = facts_.on_device ? kMaxBranches : 1;
    const auto piece = [&](int64_t num_steps, double shrink) {
      const double pixels = facts_.megapixels / (shrink * shrink);
      const int at_once = StepsAtOnce(num_branches, options, std::llround(1e6 * pixels));
      return PlannedStage::Piece{num_steps,
                                 cost.step / at_once + cost.megapixel * pixels + gaussians};
    };
    AddSteps(Stage::kReconstruct, {piece(coarse / 2, 4), piece(coarse - coarse / 2, 2),
                                   piece(options.num_steps - coarse, 1)});
  }

  ReconstructOptions FittedReconstruct() const {
    return FitToViews(settings_.reconstruct, {TrainingViews(), 1e6 * facts_.megapixels});
  }

  double TrainingViews() const {
    const auto held_out = NumHeldOut(settings_.import, facts_.num_photographs);
    return photos_ - static_cast<double>(held_out);
  }

  // Returns the budget of density control; see ReconstructOptions::pixels_per_gaussian.
  double MillionGaussians(const ReconstructOptions& options) const {
    const double pixels = TrainingViews() * facts_.megapixels;
    const double most = 1e-6 * static_cast<double>(options.max_gaussians);
    return options.pixels_per_gaussian > 0 ? std::min(most, pixels / options.pixels_per_gaussian)
                                           : most;
  }

  void AddScores() {
    const auto photos = static_cast<int64_t>(photos_);
    const auto views = static_cast<double>(NumHeldOut(settings_.import, photos));
    AddOnCores(Stage::kEvaluate,
               views * facts_.megapixels * (kScores + (facts_.has_lpips ? kLpips : 0)));
  }

  // The first step has the cost of what is prepared before it.
  void AddFeatures() {
    const int64_t num_steps = settings_.features.num_steps;
    const StepCost cost = facts_.on_device ? kFeaturesOnDevice : kFeaturesOnCores;
    const SetupCost setup = facts_.on_device ? kFeatureSetupOnDevice : kFeatureSetupOnCores;
    const double step = cost.step + cost.million * MillionGaussians(FittedReconstruct());
    AddSteps(Stage::kFeatures,
             {{1, step + setup.seconds + setup.megapixel * photos_ * facts_.megapixels},
              {num_steps - 1, step}});
  }

  const TrainingFacts& facts_;
  const TrainingSettings& settings_;
  double photos_;
  std::vector<PlannedStage> stages_;
};

}  // namespace

std::vector<PlannedStage> PlanStages(const TrainingFacts& facts, const TrainingSettings& settings) {
  return Planner(facts, settings).Plan();
}

bool PriorsComeFirst(const TrainingFacts& facts, const PriorOptions& priors) {
  const ExpectedPriors expected = Expect(facts, priors);
  return expected.by_command || !expected.any();
}

bool RunsPrograms(const TrainingFacts& facts, const PriorOptions& priors) {
  return !facts.has_poses || (facts.has_priors_command && Expect(facts, priors).by_command);
}

}  // namespace pepeseg
