#include "tests/bench/segment_rows.h"

#include <cstdio>

#include "absl/strings/str_cat.h"
#include "tests/bench/truth_views.h"

namespace pepeseg {
namespace {

std::string NameOf(const SegmentRow& row, const EntityScores& entity) {
  const auto id = static_cast<size_t>(IdOf(entity.name));
  return id < row.level->entities.size() ? row.level->entities[id] : "";
}

// The reference view of a click has the mask of the entity: there is a choice.
ChoiceScores ChosenFor(const EntityScores& entity) {
  return entity.reference_choice.value_or(ChoiceScores());
}

}  // namespace

void PrintHeader(const EvaluationOptions& protocol) {
  std::string head =
      "| run | seed | level | entities | mIoU | mBIoU | oracle mIoU | oracle mBIoU |";
  std::string rule = "|---|---|---|---|---|---|---|---|";
  for (const double scale : protocol.scales) {
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
  const GroupScores& scores = row.scores.scene;
  const MaskScores chosen = scores.reference_choice.value_or(MaskScores());
  std::printf("| %s | %d | %s | %d | %.4f | %.4f | %.4f | %.4f |", name.c_str(),
              static_cast<int>(row.seed), row.level->name.c_str(), scores.num_entities, chosen.iou,
              chosen.boundary_iou, scores.paper.iou, scores.paper.boundary_iou);
  for (const double iou : scores.iou_by_scale) std::printf(" %.3f |", iou);
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
  for (const EntityScores& score : row.scores.entities) {
    const std::string name = NameOf(row, score);
    const ChoiceScores chosen = ChosenFor(score);
    const PointPrompt click = score.click.value_or(PointPrompt());
    std::printf(
        "# %d %s %3d %-16s %2d views, click %s (%.1f, %.1f)%s: %.3f / %.3f at %.2f, %.2f; oracle "
        "%.3f / %.3f at %.2f, %.2f\n",
        static_cast<int>(row.seed), row.level->name.c_str(), IdOf(score.name), name.c_str(),
        1 + static_cast<int>(score.scored.size()), score.reference.c_str(), click.x, click.y,
        score.missing ? " on nothing" : "", chosen.mean.iou, chosen.mean.boundary_iou, chosen.scale,
        chosen.threshold, score.paper.mean.iou, score.paper.mean.boundary_iou, score.paper.scale,
        score.paper.threshold);
  }
}

void PrintClicks(const SegmentRow& row, const ClickOptions& options, const EvaluationResult& scores,
                 bool by_entity) {
  const GroupScores& scene = scores.scene;
  std::printf(
      "# %d %s: NoC@%.0f %.2f of at most %d, %.1f %% reached; IoU after 1, 2, 3 clicks %.4f %.4f "
      "%.4f\n",
      static_cast<int>(row.seed), row.level->name.c_str(), 100 * options.min_iou, scene.num_clicks,
      options.max_clicks, 100 * scene.reached, scene.iou_after[0], scene.iou_after[1],
      scene.iou_after[2]);
  if (!by_entity) return;
  for (const EntityScores& entity : scores.entities) {
    const EntityClicks clicks = entity.clicks.value_or(EntityClicks());
    std::printf("# %d %s %3d %-16s %2d clicks%s:", static_cast<int>(row.seed),
                row.level->name.c_str(), IdOf(entity.name), NameOf(row, entity).c_str(),
                clicks.num_clicks, clicks.reached ? "" : ", not reached");
    for (const ClickAnswer& answer : clicks.answers) {
      std::printf(" %c(%.0f, %.0f)%s %.3f/%.3f", answer.click.positive ? '+' : '-', answer.click.x,
                  answer.click.y, answer.on_nothing ? "!" : "", answer.reference_iou, answer.iou);
    }
    std::printf("\n");
  }
}

}  // namespace pepeseg
