#include "tests/bench/segment_rows.h"

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/resolve_prompt.h"

namespace pepeseg {
namespace {

std::string NameOf(const SegmentRow& row, int entity) {
  const auto id = static_cast<size_t>(entity);
  return id < row.level->entities.size() ? row.level->entities[id] : "";
}

}  // namespace

void PrintHeader(const OneClickOptions& protocol) {
  std::string head =
      "| run | seed | level | entities | mIoU | mBIoU | oracle mIoU | oracle mBIoU |";
  std::string rule = "|---|---|---|---|---|---|---|---|";
  for (const double scale : protocol.fixed_scales) {
    head += absl::StrCat(" ", scale, " |");
    rule += "---|";
  }
  std::printf("Fixed scales: mIoU at the threshold %.2f.\n\n", protocol.fixed_threshold);
  std::printf(
      "%s stage one s | stage two s | evaluation s | Gaussians | PSNR | stage one core s | "
      "stage two core s | SSIM | steps | feature steps | MB |\n",
      head.c_str());
  std::printf("%s---|---|---|---|---|---|---|---|---|---|---|\n", rule.c_str());
  std::fflush(stdout);
}

void PrintRow(const std::string& name, const SegmentRow& row) {
  const OneClickScores& scores = row.scores;
  std::printf("| %s | %d | %s | %d | %.4f | %.4f | %.4f | %.4f |", name.c_str(),
              static_cast<int>(row.seed), row.level->name.c_str(),
              static_cast<int>(scores.entities.size()), scores.chosen.iou,
              scores.chosen.boundary_iou, scores.oracle.iou, scores.oracle.boundary_iou);
  for (const double iou : scores.fixed_iou) std::printf(" %.3f |", iou);
  const double seconds = row.geometry->seconds;
  seconds < 0 ? std::printf(" read |") : std::printf(" %.2f |", seconds);
  std::printf(" %.2f | %.2f | %ld | %.3f | %.2f | %.2f |", row.feature_seconds,
              row.evaluate_seconds, static_cast<long>(row.geometry->gaussians.count),
              row.geometry->held_out.psnr, row.geometry->core_seconds, row.feature_core_seconds);
  std::printf(" %.4f | %ld | %ld | %.0f |\n", row.geometry->held_out.ssim,
              static_cast<long>(row.geometry->num_steps), static_cast<long>(row.num_feature_steps),
              1e-6 * static_cast<double>(row.bytes));
  std::fflush(stdout);
}

void PrintEntities(const SegmentRow& row) {
  for (const EntityScore& score : row.scores.entities) {
    const std::string name = NameOf(row, score.id);
    std::printf(
        "# %d %s %3d %-16s %2d views, click %s (%.1f, %.1f)%s: %.3f / %.3f at %.2f, %.2f; oracle "
        "%.3f / %.3f at %.2f, %.2f\n",
        static_cast<int>(row.seed), row.level->name.c_str(), score.id, name.c_str(),
        static_cast<int>(score.views.size()), score.views[0].view.c_str(), score.click.x,
        score.click.y, score.missing ? " on nothing" : "", score.chosen.iou,
        score.chosen.boundary_iou, score.chosen.scale, score.chosen.threshold, score.oracle.iou,
        score.oracle.boundary_iou, score.oracle.scale, score.oracle.threshold);
  }
}

void PrintClicks(const SegmentRow& row, const ClickOptions& options, const ClickScores& scores,
                 bool by_entity) {
  std::printf(
      "# %d %s: NoC@%.0f %.2f of at most %d, %.1f %% reached; IoU after 1, 2, 3 clicks %.4f %.4f "
      "%.4f\n",
      static_cast<int>(row.seed), row.level->name.c_str(), 100 * options.min_iou, scores.num_clicks,
      options.max_clicks, 100 * scores.reached, scores.iou_after[0], scores.iou_after[1],
      scores.iou_after[2]);
  if (!by_entity) return;
  for (const EntityClicks& score : scores.entities) {
    std::printf("# %d %s %3d %-16s %2d clicks%s:", static_cast<int>(row.seed),
                row.level->name.c_str(), score.id, NameOf(row, score.id).c_str(), score.num_clicks,
                score.reached ? "" : ", not reached");
    for (const ClickAnswer& answer : score.answers) {
      std::printf(" %c(%.0f, %.0f)%s %.3f/%.3f", answer.click.positive ? '+' : '-', answer.click.x,
                  answer.click.y, answer.on_nothing ? "!" : "", answer.reference_iou, answer.iou);
    }
    std::printf("\n");
  }
}

absl::Status DumpMasks(const Segmenter& segmenter, const std::vector<LabeledView>& views,
                       const SegmentRow& row, const std::string& folder) {
  for (const EntityScore& score : row.scores.entities) {
    const auto reference = std::ranges::find_if(
        views, [&](const LabeledView& view) { return view.view.name == score.views[0].view; });
    ASSIGN_OR_RETURN(
        const Query query,
        ResolvePrompt(segmenter, {reference->view, std::vector<PointPrompt>{score.click}},
                      {score.chosen.scale, score.chosen.threshold}));
    for (const LabeledView& view : views) {
      const ModelView target[] = {view.view};
      ASSIGN_OR_RETURN(const auto results, segmenter.Segment(query, target));
      const SegmentResult& result = results[0];
      std::ofstream file(
          absl::StrCat(folder, "/", row.level->name, "_", score.id, "_", view.view.name, ".ppm"),
          std::ios::binary);
      file << "P6 " << result.width << " " << result.height << " 255\n";
      for (size_t i = 0; i < view.labels.size(); ++i) {
        const bool got = result.mask.pixels[i] != 0, want = view.labels[i] == score.id;
        const char rgb[3] = {static_cast<char>(got ? 255 : 0),
                             static_cast<char>(got && want ? 255 : 0),
                             static_cast<char>(want ? 255 : 0)};
        file.write(rgb, 3);
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
