// Measures error against time of stage one: trains on a capture pack and scores the held-out views
// at fixed shares of the run, with the clock stopped. One table row per score. With --gaussians it
// scores the PLY of any trainer, such as a rival's, on the same views.

#include <cstdio>
#include <iostream>
#include <memory>
#include <string>

#include "core/base/status_macros.h"
#include "core/evaluate/image_scores.h"
#include "core/formats/gaussian_ply.h"
#include "core/reconstruct/trainer.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/capture_faults.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/stage_flags.h"

namespace pepeseg {
namespace {

struct BenchOptions : StageOptions {
  std::string pack, gaussians;
  std::string device = "cpu";
  std::string name = "run";
  int num_scores = 10;
  int num_seeds = 1;
  bool strip_masks = false;
  CaptureFaults faults;
  bool kernels = false;
};

// Mean scores, and the PSNR of each view.
absl::StatusOr<std::string> Score(Backend& backend, const Capture& capture,
                                  const Gaussians& gaussians) {
  ASSIGN_OR_RETURN(const auto scores, ScoreHeldOut(backend, capture, gaussians));
  char text[64];
  std::snprintf(text, sizeof(text), "%.3f | %.4f |", Mean(scores).psnr, Mean(scores).ssim);
  std::string cells = text;
  for (const ViewScores& view : scores) {
    std::snprintf(text, sizeof(text), " %.2f", view.scores.psnr);
    cells += text;
  }
  return cells;
}

absl::Status Train(Backend& backend, const Capture& capture, const BenchOptions& options,
                   uint64_t seed) {
  ReconstructOptions stage = options.reconstruct;
  stage.seed = seed;
  double seconds = 0, start = Now();
  double core_seconds = 0, core_start = CoreNow();
  ASSIGN_OR_RETURN(const auto trainer, GaussianTrainer::Create(backend, capture, stage));
  while (!trainer->done()) {
    ASSIGN_OR_RETURN(const StepReports reports, trainer->Step());
    const StepReport& report = reports.back();
    const auto scores_due = [&](int64_t step) {
      return step * options.num_scores / stage.num_steps;
    };
    if (scores_due(report.step) == scores_due(report.step - 1) && !trainer->done()) continue;
    backend.Sync();
    seconds += Now() - start;
    core_seconds += CoreNow() - core_start;
    ASSIGN_OR_RETURN(const std::string cells, Score(backend, capture, trainer->Result()));
    std::printf("| %s | %d | %d | %.2f | %ld | %s | %.4f | %ld | %.0f | %.2f |\n",
                options.name.c_str(), static_cast<int>(seed), static_cast<int>(report.step),
                seconds, static_cast<long>(report.num_gaussians), cells.c_str(), report.loss,
                static_cast<long>(report.num_overflowed_renders),
                1e-6 * static_cast<double>(backend.bytes_in_use()), core_seconds);
    std::fflush(stdout);
    start = Now();
    core_start = CoreNow();
  }
  for (const SkippedPart& skipped : trainer->skipped()) {
    std::printf("# %s, seed %d, step %d: %s skipped: %s; saves %d steps\n", options.name.c_str(),
                static_cast<int>(seed), static_cast<int>(skipped.step),
                std::string(NameOf(skipped.part)).c_str(), skipped.reason.c_str(),
                static_cast<int>(skipped.saved_steps));
  }
  return absl::OkStatus();
}

absl::Status Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(CapturePack pack, ReadCapturePack(options.pack));
  Spoil(options.faults, pack);
  Capture& capture = pack.capture;
  for (View& view : capture.views) {
    if (options.strip_masks) view.masks = {};
  }
  std::vector<KernelTime> times;
  const auto backend = MakeBenchBackend(options.device, 0, options.kernels ? &times : nullptr);
  if (backend == nullptr) return absl::UnavailableError("no such device");
  if (!options.gaussians.empty()) {
    ASSIGN_OR_RETURN(const Gaussians gaussians,
                     ReadGaussianPly(options.gaussians, options.gaussians));
    ASSIGN_OR_RETURN(const std::string cells, Score(*backend, capture, gaussians));
    std::printf("| run | Gaussians | PSNR | SSIM | PSNR by view |\n|---|---|---|---|---|\n");
    std::printf("| %s | %ld | %s |\n", options.name.c_str(), static_cast<long>(gaussians.count),
                cells.c_str());
    return absl::OkStatus();
  }
  std::printf(
      "| run | seed | step | stage one s | Gaussians | PSNR | SSIM | PSNR by view | loss | "
      "overflowed renders | MB | stage one core s "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (int k = 0; k < options.num_seeds; ++k) {
    RETURN_IF_ERROR(Train(*backend, capture, options, options.reconstruct.seed + k));
  }
  backend->Sync();
  for (const KernelTime& time : times) {
    std::printf("| %s | %.1f ms | %ld calls | %.1f us |\n", time.name.c_str(), time.ms,
                static_cast<long>(time.calls), 1e3 * time.ms / static_cast<double>(time.calls));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Held-out PSNR and SSIM against seconds of stage one");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("--device", options.device, "cpu or cuda");
  app.add_option("--name", options.name, "first column");
  app.add_option("--gaussians", options.gaussians, "PLY to score in place of a training")
      ->check(CLI::ExistingFile);
  app.add_option("--scores", options.num_scores);
  app.add_option("--seeds", options.num_seeds);
  pepeseg::AddFaultFlags(app, options.faults);
  app.add_flag("--no-masks", options.strip_masks);
  app.add_flag("--kernels", options.kernels, "device time by kernel; slows the run");
  pepeseg::AddStageFlags(app, options);
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
