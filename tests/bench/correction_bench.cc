// Measures corrections: each of some entities is corrected by its true mask in one view, its
// reference, and all entities are then scored by one click in all other views, and compared with
// the scores of before.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/correct/correct_field.h"
#include "core/evaluate/evaluate.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/bench_clock.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/truth_views.h"

namespace pepeseg {
namespace {

struct BenchOptions {
  std::string pack, gaussians, field, name = "run", device = "cpu";
  int num_threads = 2;
  int num_entities = 8;  // to correct
  int num_masks = 1;     // views that each correction has
  double below = 0.9;    // IoU under which entities are corrected
  bool entities = false;
};

absl::Status GoOn() { return absl::OkStatus(); }

// An entity of a level.
using EntityKey = std::pair<std::string, std::string>;
struct EntityScore {
  double chosen = 0, automatic = 0;  // IoU: scale chosen in the reference view, and by the click
  std::string reference;
};
using Scores = std::map<EntityKey, EntityScore>;

Model ModelOf(const CapturePack& pack, const Gaussians& gaussians, FeatureField field) {
  Model model;
  model.gaussians = gaussians;
  model.field = std::move(field);
  model.scene_radius = SceneRadius(pack.capture);
  for (const View& view : pack.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  return model;
}

absl::StatusOr<Scores> Score(const Segmenter& segmenter, const CapturePack& pack) {
  Scores scores;
  for (const TruthLevel& level : pack.truth) {
    EvaluationRequest request;
    ASSIGN_OR_RETURN(request.views, TruthViews(pack.capture, level));
    const auto result = Evaluate(segmenter, std::move(request), {}, GoOn);
    RETURN_IF_ERROR(result.status());
    for (const EntityScores& entity : result->entities) {
      const double automatic = entity.automatic.mean.iou;
      const double chosen = entity.reference_choice ? entity.reference_choice->mean.iou : automatic;
      scores[{level.name, entity.name}] = {chosen, automatic, entity.reference};
    }
  }
  return scores;
}

// Returns the masks of an entity in its reference view and, if more are wanted, in the first others
// that show it.
absl::StatusOr<std::vector<Correction>> MasksOf(const CapturePack& pack, const EntityKey& entity,
                                                const std::string& reference, int num_masks) {
  std::vector<Correction> corrections;
  for (const TruthLevel& level : pack.truth) {
    if (level.name != entity.first) continue;
    ASSIGN_OR_RETURN(std::vector<TruthView> views, TruthViews(pack.capture, level));
    std::stable_partition(views.begin(), views.end(),
                          [&](const TruthView& view) { return view.view.name == reference; });
    for (const TruthView& view : views) {
      std::vector<uint8_t> mask = MaskIn(view, entity.second);
      if (std::count(mask.begin(), mask.end(), uint8_t{1}) < 100) continue;
      if (static_cast<int>(corrections.size()) == num_masks) break;
      corrections.push_back({view.view, {std::move(mask)}});
    }
  }
  return corrections;
}

// Sums over the corrections of a scene.
struct Sums {
  double corrected = 0, corrected_automatic = 0, others = 0, seconds = 0, core_seconds = 0;
  double before = 0, after = 0;  // IoU of the corrected masks
  double worst_other = 0;
  int num = 0;
};

absl::Status CorrectOne(Backend& backend, const CapturePack& pack, const Segmenter& segmenter,
                        const Scores& before, const EntityKey& entity, const BenchOptions& options,
                        Sums& sums) {
  const EntityScore& was = before.at(entity);
  ASSIGN_OR_RETURN(const std::vector<Correction> masks,
                   MasksOf(pack, entity, was.reference, options.num_masks));
  const double start = Now(), core_start = CoreNow();
  ASSIGN_OR_RETURN(CorrectedField corrected, CorrectField(segmenter, masks, std::nullopt, GoOn));
  const double seconds = Now() - start;
  sums.seconds += seconds;
  sums.core_seconds += CoreNow() - core_start;
  ASSIGN_OR_RETURN(const auto taught,
                   Segmenter::Create(backend, ModelOf(pack, segmenter.model().gaussians,
                                                      std::move(corrected.field))));
  ASSIGN_OR_RETURN(const Scores after, Score(*taught, pack));
  double others = 0, worst = 0;
  for (const auto& [key, score] : after) {
    if (key == entity) continue;
    const double change = score.chosen - before.at(key).chosen;
    others += change / static_cast<double>(after.size() - 1);
    worst = std::min(worst, change);
  }
  const EntityScore& is = after.at(entity);
  if (options.entities) {
    std::printf(
        "# %s %s: %.4f to %.4f (automatic %.4f to %.4f), others %+.4f, worst %+.4f; masks %.4f to "
        "%.4f at scale %.2f; %ld Gaussians, %.2f s\n",
        entity.first.c_str(), entity.second.c_str(), was.chosen, is.chosen, was.automatic,
        is.automatic, others, worst, corrected.iou_before[0], corrected.iou_after[0],
        corrected.scale, static_cast<long>(corrected.num_changed), seconds);
    std::fflush(stdout);
  }
  sums.corrected += is.chosen - was.chosen;
  sums.corrected_automatic += is.automatic - was.automatic;
  sums.others += others;
  sums.worst_other = std::min(sums.worst_other, worst);
  sums.before += corrected.iou_before[0];
  sums.after += corrected.iou_after[0];
  ++sums.num;
  return absl::OkStatus();
}

absl::Status Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(const CapturePack pack, ReadCapturePack(options.pack));
  const auto backend = MakeBenchBackend(options.device, options.num_threads, nullptr);
  if (backend == nullptr) return absl::UnavailableError("no such device");
  ASSIGN_OR_RETURN(const Gaussians gaussians, ReadGaussianPly(options.gaussians, "PLY"));
  ASSIGN_OR_RETURN(FeatureField field, ReadFeatureFile(options.field, "features"));
  ASSIGN_OR_RETURN(const auto segmenter,
                   Segmenter::Create(*backend, ModelOf(pack, gaussians, std::move(field))));
  ASSIGN_OR_RETURN(const Scores before, Score(*segmenter, pack));
  std::vector<EntityKey> wrong;
  for (const auto& [key, score] : before) {
    if (score.chosen < options.below) wrong.push_back(key);
  }
  Sums sums;
  const size_t num = std::min(wrong.size(), static_cast<size_t>(options.num_entities));
  for (size_t i = 0; i < num; ++i) {
    // Evenly over the levels and their entities.
    const EntityKey& entity = wrong[i * wrong.size() / num];
    RETURN_IF_ERROR(CorrectOne(*backend, pack, *segmenter, before, entity, options, sums));
  }
  if (sums.num == 0) return absl::OkStatus();
  const double n = sums.num;
  std::printf(
      "| %s | %zu | %zu | %d | %+.1f | %+.1f | %+.2f | %+.1f | %.1f to %.1f | %.2f | %.2f |\n",
      options.name.c_str(), before.size(), wrong.size(), sums.num, 100 * sums.corrected / n,
      100 * sums.corrected_automatic / n, 100 * sums.others / n, 100 * sums.worst_other,
      100 * sums.before / n, 100 * sums.after / n, sums.seconds / n, sums.core_seconds / n);
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Corrections of entities of a capture pack, scored in the views not corrected");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("--gaussians", options.gaussians, "PLY of the model")->required();
  app.add_option("--field", options.field, "features of the model")->required();
  app.add_option("--name", options.name, "first column");
  app.add_option("--device", options.device, "cpu or cuda");
  app.add_option("--threads", options.num_threads, "threads of the CPU; 0: all cores");
  app.add_option("--corrected", options.num_entities, "number of entities to correct, one by one");
  app.add_option("--masks", options.num_masks, "masks of each correction, of different views");
  app.add_option("--below", options.below, "IoU under which entities are corrected");
  app.add_flag("--entities", options.entities, "also print a line for each correction");
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
