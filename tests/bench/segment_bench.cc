// Measures segmentation by the one-click protocol: trains both stages on a capture pack and scores
// every level of its ground truth on the held-out views. One table row per seed and level.

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "core/base/status_macros.h"
#include "core/evaluate/evaluate.h"
#include "core/evaluate/image_scores.h"
#include "core/features/options.h"
#include "core/features/trainer.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/query/propose.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/capture_faults.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/click_times.h"
#include "tests/bench/decomposition_scores.h"
#include "tests/bench/granularity.h"
#include "tests/bench/pack_images.h"
#include "tests/bench/prompt_scores.h"
#include "tests/bench/sam_prompt_scores.h"
#include "tests/bench/segment_rows.h"
#include "tests/bench/stage_flags.h"
#include "tests/bench/truth_views.h"
#include "tests/testing/run_trainers.h"

namespace pepeseg {
namespace {

struct BenchOptions : StageOptions {
  std::string pack, gaussians, field, turn, sam;
  std::string device = "cpu";
  std::string name = "run";
  int num_threads = 0;
  int num_seeds = 1;
  int64_t snapshot_step = 0;
  CaptureFaults faults;
  int num_unscored = 0;
  bool entities = false;
  bool kernels = false;
  bool granularity = false;
  bool prompts = false;
  bool clicks = false;
  bool click_times = false;
  bool boxes = false;
  bool selections = false;
  bool decompose = false;
  bool rows_only = false;
  EvaluationOptions protocol;
  ClickOptions click_protocol;
};

absl::Status GoOn() { return absl::OkStatus(); }

// Locks a file while it lives, so that runs side by side train one at a time and their seconds stay
// comparable. Does nothing without a path.
class TrainingTurn {
 public:
  explicit TrainingTurn(const std::string& path) {
    if (path.empty()) return;
    file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file_ < 0 || flock(file_, LOCK_EX) != 0) std::perror(path.c_str());
  }
  ~TrainingTurn() { End(); }
  TrainingTurn(const TrainingTurn&) = delete;
  TrainingTurn& operator=(const TrainingTurn&) = delete;

  void End() {
    if (file_ >= 0) close(file_);
    file_ = -1;
  }

 private:
  int file_ = -1;
};

// Counts the steps of a stage.
auto CountTo(int64_t& num_steps) {
  return [&num_steps](const StepReport& report) {
    num_steps = report.step;
    return absl::OkStatus();
  };
}

absl::StatusOr<Geometry> GetGeometry(Backend& backend, const Capture& capture,
                                     const BenchOptions& options, uint64_t seed) {
  Geometry geometry;
  if (!options.gaussians.empty() && std::filesystem::exists(options.gaussians)) {
    ASSIGN_OR_RETURN(geometry.gaussians, ReadGaussianPly(options.gaussians, options.gaussians));
  } else {
    ReconstructOptions stage = options.reconstruct;
    stage.seed = seed;
    const double start = Now(), core_start = CoreNow();
    ASSIGN_OR_RETURN(geometry.gaussians,
                     testing::TrainGaussians(backend, capture, stage, CountTo(geometry.num_steps)));
    geometry.seconds = Now() - start;
    geometry.core_seconds = CoreNow() - core_start;
    if (!options.gaussians.empty()) {
      RETURN_IF_ERROR(WriteGaussianPly(options.gaussians, geometry.gaussians));
    }
  }
  ASSIGN_OR_RETURN(const auto scores, ScoreHeldOut(backend, capture, geometry.gaussians));
  geometry.held_out = Mean(scores);
  geometry.least_psnr = scores.empty() ? 0 : scores[0].scores.psnr;
  for (const ViewScores& view : scores) {
    geometry.least_psnr = std::min(geometry.least_psnr, view.scores.psnr);
  }
  return geometry;
}

// Returns the field after at least `step` steps, as a training writes it while it goes on.
absl::StatusOr<FeatureField> SnapshotOf(FeatureTrainer& training, int64_t step) {
  while (training.step() < step && !training.done()) RETURN_IF_ERROR(training.Step().status());
  const double start = Now(), core_start = CoreNow();
  FeatureField field = training.Snapshot();
  std::printf("# a snapshot takes %.3f s, %.3f core s\n", Now() - start, CoreNow() - core_start);
  return field;
}

absl::StatusOr<FeatureField> GetField(Backend& backend, const Capture& capture,
                                      const Geometry& geometry, const BenchOptions& options,
                                      const FeatureOptions& stage, int64_t& num_steps) {
  if (!options.field.empty() && std::filesystem::exists(options.field)) {
    return ReadFeatureFile(options.field, options.field);
  }
  ASSIGN_OR_RETURN(const auto training,
                   FeatureTrainer::Create(backend, capture, geometry.gaussians, stage));
  FeatureField field;
  if (options.snapshot_step == 0) {
    ASSIGN_OR_RETURN(field, RunSteps(*training, CountTo(num_steps)));
  } else {
    ASSIGN_OR_RETURN(field, SnapshotOf(*training, options.snapshot_step));
    num_steps = training->step();
  }
  if (training->mask_quality()) std::printf("# mask quality %.4f\n", *training->mask_quality());
  if (!options.field.empty()) RETURN_IF_ERROR(WriteFeatureFile(options.field, field));
  return field;
}

// Prints as comments.
absl::Status PrintGranularity(Backend& backend, const Capture& capture, const Model& model,
                              const std::vector<double>& scales) {
  ASSIGN_OR_RETURN(const auto measured, MeasureGranularity(backend, capture, model, scales));
  for (const ClusterSizes& at : measured) {
    std::printf("# scale %.2f: %.1f clusters of %.0f pixels, %.1f %% in none\n", at.scale,
                at.num_clusters, at.mean_pixels, 100 * at.noise_share);
  }
  return absl::OkStatus();
}

// Prints as a comment.
absl::Status PrintPrompts(const Segmenter& segmenter, const CapturePack& pack,
                          const SegmentRow& row, const TaskOptions& options) {
  std::vector<std::vector<TruthView>> levels;
  for (const TruthLevel& level : pack.truth) {
    ASSIGN_OR_RETURN(levels.emplace_back(), TruthViews(pack.capture, level));
  }
  EvaluationRequest request;
  request.views = levels[static_cast<size_t>(row.level - pack.truth.data())];
  ASSIGN_OR_RETURN(const EvaluationTask task, MakeTask(std::move(request), options));
  ASSIGN_OR_RETURN(const PromptScores scores, ScorePrompts(segmenter, task, levels));
  std::printf(
      "# %s: chosen %.4f; first proposal %.4f (as whatever level it suits %.4f), best of three "
      "%.4f, of %d %.4f; mask %.4f, box %.4f; selection %.4f, against the masks %.4f; a click's "
      "scale and threshold take %.2f ms\n",
      row.level->name.c_str(), row.scores.scene.reference_choice.value_or(MaskScores()).iou,
      scores.first_iou, scores.first_thing_iou, scores.best_of_three_iou, kDefaultProposals,
      scores.best_iou, scores.mask_iou, scores.box_iou, scores.selection_iou,
      scores.selection_against_masks, scores.choosing_ms);
  return absl::OkStatus();
}

// Prints as a comment what a run without a row of the table would not show.
void PrintTraining(Backend& backend, const Geometry& geometry, uint64_t seed, double seconds) {
  std::printf(
      "# %d trained: %.3f dB, least view %.3f; stage one %.2f s, stage two %.2f s; %ld Gaussians; "
      "%.0f MB of the device\n",
      static_cast<int>(seed), geometry.held_out.psnr, geometry.least_psnr, geometry.seconds,
      seconds, static_cast<long>(geometry.gaussians.count),
      1e-6 * static_cast<double>(backend.peak_bytes_in_use()));
}

SamOptions SamOn(const BenchOptions& options) {
  SamOptions sam = {.num_threads = std::max(1, options.num_threads)};
  if (options.device == "cuda") sam.cuda_device = 0;
  return sam;
}

// images: may be null.
absl::Status ScoreClicks(const Segmenter& segmenter, ImageSegmenter* images,
                         const EvaluationRequest& request, const SegmentRow& row,
                         const BenchOptions& options) {
  EvaluationOptions by_clicks = options.protocol;
  by_clicks.protocol = Protocol::kClicks;
  by_clicks.clicks = options.click_protocol;
  ASSIGN_OR_RETURN(const EvaluationResult clicks,
                   Evaluate(segmenter, request, by_clicks, GoOn, images));
  PrintClicks(row, options.click_protocol, clicks, options.entities);
  if (!options.click_times) return absl::OkStatus();
  ASSIGN_OR_RETURN(const EvaluationTask task, MakeTask(request, options.protocol.task));
  return PrintClickTimes(segmenter, images, task, clicks);
}

// Trains stage two, ends the turn, and scores the model.
absl::Status Segment(Backend& backend, const CapturePack& pack, const BenchOptions& options,
                     const Geometry& geometry, int run, TrainingTurn& turn) {
  FeatureOptions stage = options.features;
  stage.seed += run;
  int64_t num_steps = 0;
  Model model;
  const double start = Now(), core_start = CoreNow();
  ASSIGN_OR_RETURN(model.field,
                   GetField(backend, pack.capture, geometry, options, stage, num_steps));
  const double feature_seconds = Now() - start, feature_core_seconds = CoreNow() - core_start;
  turn.End();
  PrintTraining(backend, geometry, stage.seed, feature_seconds);
  model.gaussians = geometry.gaussians;
  model.scene_radius = SceneRadius(pack.capture);
  for (const View& view : pack.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  if (options.granularity) {
    RETURN_IF_ERROR(PrintGranularity(backend, pack.capture, model, options.protocol.scales));
  }
  ASSIGN_OR_RETURN(const auto segmenter, Segmenter::Create(backend, std::move(model)));
  std::unique_ptr<SamBorders> sam;
  std::unique_ptr<PackImages> images;
  if (!options.sam.empty()) {
    ASSIGN_OR_RETURN(sam, SamBorders::Open(options.sam, SamOn(options)));
    images = std::make_unique<PackImages>(*sam, pack.capture);
  }
  if (options.decompose) RETURN_IF_ERROR(PrintDecomposition(*segmenter, pack));
  for (const TruthLevel& level : pack.truth) {
    const double evaluate_start = Now();
    EvaluationRequest request;
    ASSIGN_OR_RETURN(request.views, TruthViews(pack.capture, level));
    ASSIGN_OR_RETURN(EvaluationResult scores,
                     Evaluate(*segmenter, request, options.protocol, GoOn));
    const SegmentRow row = {stage.seed,
                            &level,
                            &geometry,
                            feature_seconds,
                            feature_core_seconds,
                            Now() - evaluate_start,
                            num_steps,
                            backend.peak_bytes_in_use(),
                            std::move(scores)};
    PrintRow(options.name, row);
    if (options.entities) PrintEntities(row);
    if (options.prompts) {
      RETURN_IF_ERROR(PrintPrompts(*segmenter, pack, row, options.protocol.task));
    }
    if (options.clicks) {
      RETURN_IF_ERROR(ScoreClicks(*segmenter, nullptr, request, row, options));
      if (images != nullptr) {
        std::printf("# by SAM and the field:\n");
        RETURN_IF_ERROR(ScoreClicks(*segmenter, images.get(), request, row, options));
      }
    }
    if (options.boxes || options.selections) {
      ASSIGN_OR_RETURN(const EvaluationTask task, MakeTask(request, options.protocol.task));
      if (options.boxes) {
        RETURN_IF_ERROR(PrintBoxes(*segmenter, images.get(), task, options.entities));
      }
      if (options.selections) RETURN_IF_ERROR(PrintSelections(*segmenter, images.get(), task));
    }
  }
  return absl::OkStatus();
}

// Removes the labels of the first held-out views; their entities are then clicked on in the next
// view.
void LeaveUnscored(int num_views, CapturePack& pack) {
  const std::vector<View>& views = pack.capture.views;
  for (size_t v = 0; v < views.size() && num_views > 0; ++v) {
    if (!views[v].held_out) continue;
    for (TruthLevel& level : pack.truth) level.labels[v].clear();
    --num_views;
  }
}

absl::Status Run(const BenchOptions& options) {
  RETURN_IF_ERROR(Validate(options.protocol));
  ASSIGN_OR_RETURN(CapturePack pack, ReadCapturePack(options.pack));
  if (pack.truth.empty()) return absl::InvalidArgumentError("the pack has no ground truth");
  std::vector<KernelTime> times;
  Spoil(options.faults, pack);
  LeaveUnscored(options.num_unscored, pack);
  const auto backend =
      MakeBenchBackend(options.device, options.num_threads, options.kernels ? &times : nullptr);
  if (backend == nullptr) return absl::UnavailableError("no such device");
  if (!options.rows_only) PrintHeader(options.protocol);
  Geometry geometry;
  for (int run = 0; run < options.num_seeds; ++run) {
    TrainingTurn turn(options.turn);
    if (run == 0 || options.gaussians.empty()) {  // one file, one geometry for all seeds
      ASSIGN_OR_RETURN(
          geometry, GetGeometry(*backend, pack.capture, options, options.reconstruct.seed + run));
    }
    RETURN_IF_ERROR(Segment(*backend, pack, options, geometry, run, turn));
  }
  backend->Sync();
  std::printf("# at most %.0f MB of the device\n",
              1e-6 * static_cast<double>(backend->peak_bytes_in_use()));
  for (const KernelTime& time : times) {
    std::printf("# %s: %.1f ms, %ld calls, %.1f us\n", time.name.c_str(), time.ms,
                static_cast<long>(time.calls), 1e3 * time.ms / static_cast<double>(time.calls));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Segmentation of a capture pack, scored by the one-click protocol");
  pepeseg::BenchOptions options;
  pepeseg::AddStageFlags(app, options);
  app.add_option("pack", options.pack)->required();
  app.add_option("--gaussians", options.gaussians,
                 "PLY with stage one's result: read if it is there, else written after stage one");
  app.add_option("--field", options.field,
                 "file with stage two's result: read if it is there, else written after stage two");
  app.add_option("--device", options.device, "cpu or cuda");
  app.add_option("--threads", options.num_threads, "threads of the CPU; 0: all cores");
  app.add_option("--turn", options.turn,
                 "file that is locked while a run trains, so that runs side by side train in turn");
  app.add_option("--name", options.name, "first column");
  app.add_option("--snapshot", options.snapshot_step,
                 "score the field after this many steps of stage two; 0: at its end");
  app.add_option("--seeds", options.num_seeds, "runs, each with the next seed in both stages");
  app.add_option("--fixed-threshold", options.protocol.fixed_threshold);
  app.add_flag("!--no-refine-borders", options.protocol.refine_borders,
               "score masks that are exactly the pixels above the threshold");
  pepeseg::AddFaultFlags(app, options.faults);
  app.add_option(
      "--unscored", options.num_unscored,
      "number of held-out views, from the first, that are neither clicked on nor scored");
  app.add_flag("--granularity", options.granularity,
               "also measure clusters by scale on the held-out views");
  app.add_flag("--prompts", options.prompts,
               "also score prompts without a scale: mask, box and 3D selection");
  app.add_flag("--clicks", options.clicks,
               "also measure clicks until IoU 0.9, and IoU after 1, 2 and 3 clicks; by entity with "
               "--entities");
  app.add_flag("--click-times", options.click_times, "with --clicks: also time their answers");
  app.add_flag("--selections", options.selections, "also score selections in 3D of a click");
  app.add_flag("--boxes", options.boxes,
               "also score boxes around the entities on the clicked view and on the others");
  app.add_option("--sam", options.sam,
                 "folder of SAM's files: --clicks, --boxes and --selections also let SAM and the "
                 "field answer together");
  app.add_option("--max-clicks", options.click_protocol.max_clicks);
  app.add_flag("--decompose", options.decompose,
               "how the levels of a decomposition agree with the truth's, too");
  app.add_flag("--rows-only", options.rows_only, "omit the heading of the table");
  app.add_flag("--kernels", options.kernels, "device time by kernel; slows the run");
  app.add_flag("--entities", options.entities, "also print a line for each entity");
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
