// Measures time and memory of a training against the number of views, pixels, Gaussians and masks.
// Each grows from small to as large as the limits allow while the others stay fixed. Both stages
// run a few steps on a ray-traced scene without density control, so that there are as many
// Gaussians as points. One table row per size; scaling.py fits the exponents.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "core/base/status_macros.h"
#include "core/features/trainer.h"
#include "core/reconstruct/trainer.h"
#include "tests/bench/bench_backend.h"
#include "tests/testing/crowded_capture.h"

namespace pepeseg {
namespace {

struct Size {
  int views = 12;
  int width = 160;  // pixels; the height is 3/4 of it
  int gaussians = 10'000;
  int cuts = 1;  // pieces of each mask along both axes: up to cuts * cuts pieces per mask
};

struct BenchOptions {
  std::string device = "cpu";
  std::string dimension;  // empty: all of them
  int num_threads = 0;
  int num_steps = 60;
  double max_seconds = 60;  // a dimension ends after the first size that takes longer
  double max_bytes = 8e9;   // a dimension ends when the next size may need more device memory
  Size size;
};

// Wall time, and processor time summed over all cores.
struct Seconds {
  double wall = 0, core = 0;
};

// Measures the time since its construction.
class Stopwatch {
 public:
  Seconds Elapsed() const { return {Now() - wall_, CoreNow() - core_}; }

 private:
  double wall_ = Now(), core_ = CoreNow();
};

struct Measured {
  double masks_per_view = 0;
  Seconds setup, steps;                // stage one
  Seconds preparation, feature_steps;  // stage two
  int64_t bytes = 0;
};

// Returns the masks of a view, cut along a grid.
MaskSet Cut(const MaskSet& masks, int cuts) {
  std::vector<BinaryMask> pieces;
  for (int mask = 0; mask < masks.num_masks; ++mask) {
    const BinaryMask whole = masks.Extract(mask);
    for (int cell = 0; cell < cuts * cuts; ++cell) {
      BinaryMask piece{std::vector<uint8_t>(whole.pixels.size())};
      for (size_t i = 0; i < whole.pixels.size(); ++i) {
        const int x = static_cast<int>(i) % masks.width, y = static_cast<int>(i) / masks.width;
        const int at = y * cuts / masks.height * cuts + x * cuts / masks.width;
        piece.pixels[i] = at == cell ? whole.pixels[i] : 0;
      }
      pieces.push_back(std::move(piece));
    }
  }
  return BuildMaskSet(masks.width, masks.height, pieces);
}

Capture MakeCapture(const Size& size) {
  testing::CrowdedOptions options;
  options.num_views = size.views;
  options.width = size.width;
  options.height = size.width * 3 / 4;
  options.held_out_every = 0;
  options.num_points = size.gaussians;
  Capture capture = testing::MakeCrowdedScene(options).capture;
  for (View& view : capture.views) {
    if (size.cuts > 1) view.masks = Cut(view.masks, size.cuts);
  }
  return capture;
}

ReconstructOptions StageOne(int num_steps) {
  ReconstructOptions stage;
  stage.num_steps = num_steps;
  stage.densify_from = 0;
  stage.densify_until = 0;
  stage.pixels_per_gaussian = 0;
  stage.refine_keep = RefineKeep::kNone;
  stage.min_loss_fall = 0;
  stage.min_band_gain = 0;
  return stage;
}

FeatureOptions StageTwo(int num_steps) {
  FeatureOptions stage;
  stage.num_steps = num_steps;
  stage.steps_per_chunk = num_steps;
  stage.centroid_weight_upper =
      0;  // clustering runs every few hundred steps, too rarely for these few
  stage.min_loss_fall = 0;
  return stage;
}

absl::StatusOr<Gaussians> MeasureStageOne(Backend& backend, const Capture& capture, int num_steps,
                                          Measured& measured) {
  const Stopwatch setup;
  ASSIGN_OR_RETURN(const auto trainer,
                   GaussianTrainer::Create(backend, capture, StageOne(num_steps)));
  backend.Sync();
  measured.setup = setup.Elapsed();
  const Stopwatch steps;
  while (!trainer->done()) RETURN_IF_ERROR(trainer->Step().status());
  backend.Sync();
  measured.steps = steps.Elapsed();
  return trainer->Result();
}

absl::Status MeasureStageTwo(Backend& backend, const Capture& capture, const Gaussians& gaussians,
                             int num_steps, Measured& measured) {
  const Stopwatch preparation;
  ASSIGN_OR_RETURN(const auto stage,
                   FeatureTrainer::Create(backend, capture, gaussians, StageTwo(num_steps)));
  backend.Sync();
  measured.preparation = preparation.Elapsed();
  const Stopwatch steps;
  while (!stage->done()) RETURN_IF_ERROR(stage->Step().status());
  backend.Sync();
  measured.feature_steps = steps.Elapsed();
  return absl::OkStatus();
}

// Measures one size on a new backend, whose peak memory belongs to this size alone.
absl::StatusOr<Measured> Measure(const BenchOptions& options, const Size& size) {
  const auto backend = MakeBenchBackend(options.device, options.num_threads, nullptr);
  if (backend == nullptr) return absl::UnavailableError("no such device");
  const Capture capture = MakeCapture(size);
  Measured measured;
  for (const View& view : capture.views) {
    measured.masks_per_view += static_cast<double>(view.masks.num_masks) / size.views;
  }
  ASSIGN_OR_RETURN(const Gaussians gaussians,
                   MeasureStageOne(*backend, capture, options.num_steps, measured));
  RETURN_IF_ERROR(MeasureStageTwo(*backend, capture, gaussians, options.num_steps, measured));
  if (!backend->error().empty()) return absl::ResourceExhaustedError(backend->error());
  measured.bytes = static_cast<int64_t>(backend->peak_bytes_in_use());
  return measured;
}

// Returns the time to compare with the limit: processor time on the CPU, which other programs on
// the machine hardly affect, and wall time otherwise.
double SecondsOf(const Measured& measured, const BenchOptions& options) {
  double sum = 0;
  for (const Seconds& part :
       {measured.setup, measured.steps, measured.preparation, measured.feature_steps}) {
    sum += options.device == "cpu" ? part.core : part.wall;
  }
  return sum;
}

void PrintRow(const std::string& dimension, const Size& size, const Measured& measured,
              int num_steps) {
  std::printf("| %s | %d | %d | %d | %.1f |", dimension.c_str(), size.views,
              size.width * (size.width * 3 / 4), size.gaussians, measured.masks_per_view);
  const double ms = 1e3 / num_steps;
  std::printf(" %.3f | %.3f | %.2f | %.2f |", measured.setup.wall, measured.setup.core,
              ms * measured.steps.wall, ms * measured.steps.core);
  std::printf(" %.3f | %.3f | %.2f | %.2f | %.1f |\n", measured.preparation.wall,
              measured.preparation.core, ms * measured.feature_steps.wall,
              ms * measured.feature_steps.core, 1e-6 * static_cast<double>(measured.bytes));
  std::fflush(stdout);
}

// Grows to the next size, about twice as large except for masks.
void Grow(const std::string& dimension, Size& size) {
  if (dimension == "views") size.views *= 2;
  if (dimension == "pixels")
    size.width = static_cast<int>(std::lround(size.width * std::sqrt(2.0)));
  if (dimension == "gaussians") size.gaussians *= 2;
  if (dimension == "masks") size.cuts += 1;
}

absl::Status Climb(const BenchOptions& options, const std::string& dimension) {
  constexpr int kMostCuts = 12;
  Size size = options.size;
  if (dimension == "views") size.views = std::max(2, size.views / 4);
  if (dimension == "pixels") size.width /= 2;
  if (dimension == "gaussians") size.gaussians /= 8;
  for (int step = 0;; ++step) {
    const auto measured = Measure(options, size);
    if (!measured.ok() && step > 0) {  // this size no longer fits
      std::printf("# %s: %s\n", dimension.c_str(), measured.status().ToString().c_str());
      break;
    }
    RETURN_IF_ERROR(measured.status());
    PrintRow(dimension, size, *measured, options.num_steps);
    if (SecondsOf(*measured, options) > options.max_seconds) break;
    // Skip a size that is expected to need twice the memory.
    if (2 * static_cast<double>(measured->bytes) > options.max_bytes) break;
    if (dimension == "masks" && size.cuts >= kMostCuts) break;
    Grow(dimension, size);
  }
  return absl::OkStatus();
}

absl::Status Run(const BenchOptions& options) {
  std::printf(
      "| dimension | views | pixels | gaussians | masks | set-up s | set-up core s | step ms | "
      "step core ms | preparation s | preparation core s | feature step ms | "
      "feature step core ms | MB |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const std::string dimension : {"views", "pixels", "gaussians", "masks"}) {
    if (!options.dimension.empty() && options.dimension != dimension) continue;
    RETURN_IF_ERROR(Climb(options, dimension));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Time and memory of a training against views, pixels, Gaussians and masks");
  pepeseg::BenchOptions options;
  app.add_option("--device", options.device, "cpu or cuda");
  app.add_option("--threads", options.num_threads, "threads of the CPU; 0: all cores");
  app.add_option("--dimension", options.dimension, "views, pixels, gaussians or masks alone");
  app.add_option("--steps", options.num_steps, "steps of each stage")
      ->check(CLI::Range(2, 1'000'000));
  app.add_option(
      "--seconds", options.max_seconds,
      "time of one size after which a dimension ends; processor time of all cores on the CPU");
  app.add_option("--bytes", options.max_bytes, "device memory at which a dimension ends");
  app.add_option("--views", options.size.views, "views of the base size");
  app.add_option("--width", options.size.width, "width of the base size, pixels");
  app.add_option("--gaussians", options.size.gaussians, "Gaussians of the base size");
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
