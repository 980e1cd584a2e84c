// Measures what borders placed by SAM (core/priors/sam/sam_borders.h) do to the masks of a trained
// model: scores masks of the one-click protocol as they are, with SAM's borders in the photographs
// of the scored views, and with those in their renderings. One line for each level of the truth.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/evaluate/evaluate.h"
#include "core/evaluate/mask_scores.h"
#include "core/formats/gaussian_ply.h"
#include "core/model_files/model_file.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/resolve_prompt.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/truth_views.h"

namespace pepeseg {
namespace {

enum Border { kPlain, kPhotograph, kRendering, kNumBorders };

struct Cost {
  double seconds = 0;
  int count = 0;

  double mean() const { return count > 0 ? seconds / count : 0; }
};

// Scores masks of views with all three borders.
class BorderScorer {
 public:
  BorderScorer(const SamBorders& sam, const Segmenter& segmenter, const Capture& capture)
      : sam_(sam), segmenter_(segmenter) {
    for (const View& view : capture.views) photographs_[view.name] = &view.photo;
  }

  const Cost& embedding() const { return embedding_; }
  const Cost& refining() const { return refining_; }

  absl::StatusOr<std::array<MaskScores, kNumBorders>> Score(const Query& query, const TruthView& in,
                                                            const std::string& entity) {
    ASSIGN_OR_RETURN(const auto results,
                     segmenter_.Segment(query, {&in.view, 1}, {.refine_borders = true}));
    const std::vector<uint8_t> truth = in.MaskOf(entity);
    const int width = in.view.camera.width, height = in.view.camera.height;
    std::array<MaskScores, kNumBorders> scores;
    for (const Border border : {kPlain, kPhotograph, kRendering}) {
      BinaryMask mask = results[0].mask;
      if (border != kPlain) {
        ASSIGN_OR_RETURN(const SamEmbedding* embedding, EmbeddingOf(in.view, border));
        const double start = Now();
        ASSIGN_OR_RETURN(mask, sam_.Refine(*embedding, mask));
        refining_.seconds += Now() - start;
        ++refining_.count;
      }
      scores[border] = ScoreMask(mask.pixels, truth, width, height, in.ignore);
    }
    return scores;
  }

 private:
  absl::StatusOr<const SamEmbedding*> EmbeddingOf(const ModelView& view, Border border) {
    SamEmbedding& embedding = embeddings_[{view.name, border}];
    if (!embedding.values.empty()) return &embedding;
    Image image = *photographs_.at(view.name);
    if (border == kRendering) {
      ASSIGN_OR_RETURN(image, segmenter_.RenderColor(view));
    }
    const double start = Now();
    ASSIGN_OR_RETURN(embedding, sam_.Embed(image));
    embedding_.seconds += Now() - start;
    ++embedding_.count;
    return &embedding;
  }

  const SamBorders& sam_;
  const Segmenter& segmenter_;
  std::map<std::string, const Image*> photographs_;
  std::map<std::pair<std::string, Border>, SamEmbedding> embeddings_;
  Cost embedding_, refining_;
};

absl::Status PrintLevel(const SamBorders& sam, const Segmenter& segmenter, const CapturePack& pack,
                        const TruthLevel& level) {
  EvaluationRequest request;
  ASSIGN_OR_RETURN(request.views, TruthViews(pack.capture, level));
  const std::vector<TruthView> views = request.views;
  ASSIGN_OR_RETURN(const EvaluationResult result,
                   Evaluate(segmenter, std::move(request), {}, [] { return absl::OkStatus(); }));
  const auto view_of = [&](const std::string& name) -> const TruthView& {
    return *std::ranges::find_if(views, [&](const TruthView& v) { return v.view.name == name; });
  };
  BorderScorer scorer(sam, segmenter, pack.capture);
  std::array<double, kNumBorders> iou{}, boundary_iou{};
  for (const EntityScores& score : result.entities) {
    if (score.missing || !score.reference_choice) continue;  // scores 0 in all three
    const ChoiceScores& chosen = *score.reference_choice;
    const std::vector<PointPrompt> click = {score.click.value_or(PointPrompt())};
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(segmenter, {view_of(score.reference).view, click},
                                   {chosen.scale, chosen.threshold}));
    const double share = 1 / static_cast<double>(score.scored.size());
    for (const std::string& name : score.scored) {
      ASSIGN_OR_RETURN(const auto scores, scorer.Score(query, view_of(name), score.name));
      for (int border = 0; border < kNumBorders; ++border) {
        iou[border] += share * scores[border].iou;
        boundary_iou[border] += share * scores[border].boundary_iou;
      }
    }
  }
  const double percent = 100 / std::max(1.0, static_cast<double>(result.entities.size()));
  std::printf(
      "%s: mIoU / mBIoU %.2f / %.2f; by SAM in the photographs %.2f / %.2f, in the "
      "renderings %.2f / %.2f; %.2f s a view, %.3f s a mask\n",
      level.name.c_str(), percent * iou[kPlain], percent * boundary_iou[kPlain],
      percent * iou[kPhotograph], percent * boundary_iou[kPhotograph], percent * iou[kRendering],
      percent * boundary_iou[kRendering], scorer.embedding().mean(), scorer.refining().mean());
  return absl::OkStatus();
}

struct BenchOptions {
  std::string pack, gaussians, field, sam;
  int num_threads = 1;
};

absl::Status Run(const BenchOptions& options) {
  ASSIGN_OR_RETURN(const CapturePack pack, ReadCapturePack(options.pack));
  const auto backend = MakeBenchBackend("cpu", options.num_threads, nullptr);
  Model model;
  ASSIGN_OR_RETURN(model.gaussians, ReadGaussianPly(options.gaussians, options.gaussians));
  ASSIGN_OR_RETURN(model.field, ReadFeatureFile(options.field, options.field));
  model.scene_radius = SceneRadius(pack.capture);
  for (const View& view : pack.capture.views) {
    model.views.push_back({view.name, view.camera, view.cam_from_world, view.held_out});
  }
  ASSIGN_OR_RETURN(const auto segmenter, Segmenter::Create(*backend, std::move(model)));
  ASSIGN_OR_RETURN(const auto sam,
                   SamBorders::Open(options.sam, {.num_threads = options.num_threads}));
  for (const TruthLevel& level : pack.truth) {
    RETURN_IF_ERROR(PrintLevel(*sam, *segmenter, pack, level));
  }
  return absl::OkStatus();
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("Scores of masks with borders placed by SAM");
  pepeseg::BenchOptions options;
  app.add_option("pack", options.pack)->required();
  app.add_option("--gaussians", options.gaussians, "PLY that pepeseg_segment_bench has written")
      ->required();
  app.add_option("--field", options.field, "features that it has written")->required();
  app.add_option("--sam", options.sam, "folder of deploy/sam.sh")->required();
  app.add_option("--threads", options.num_threads, "threads of the CPU")->check(CLI::Range(1, 256));
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
