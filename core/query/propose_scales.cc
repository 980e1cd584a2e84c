#include "core/query/propose_scales.h"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/query/mask_grid.h"
#include "core/status_macros.h"
#include "kernels/ops.h"

namespace pepeseg {
namespace {

constexpr int kNumScales = 21;
constexpr double kSmallestScale = 0.01;
const std::vector<float> kThresholds = {0.5f,  0.55f, 0.6f,  0.65f, 0.7f,
                                        0.75f, 0.8f,  0.85f, 0.9f,  0.95f};
constexpr int64_t kMinArea = 16;  // pixels

double ScaleAt(int index) {
  return std::max(kSmallestScale, static_cast<double>(index) / (kNumScales - 1));
}

// The best similarity of each pixel to the points of one kind; never, where there is none.
std::vector<float> BestOf(std::span<const PointPrompt> points, bool positive,
                          std::span<const float> similarities) {
  const size_t num_pixels = similarities.size() / points.size();
  std::vector<float> best(num_pixels, -std::numeric_limits<float>::infinity());
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].positive != positive) continue;
    const std::span<const float> of_point = similarities.subspan(i * num_pixels, num_pixels);
    for (size_t p = 0; p < num_pixels; ++p) best[p] = std::max(best[p], of_point[p]);
  }
  return best;
}

}  // namespace

absl::StatusOr<std::vector<ScaleProposal>> ProposeScales(const Segmenter& segmenter,
                                                         const ModelView& view,
                                                         std::span<const PointPrompt> points,
                                                         int max_count) {
  if (max_count < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(max_count, " proposals are asked for, must be at least 1"));
  }
  Query query;
  ASSIGN_OR_RETURN(query.features, segmenter.PointFeatures(view, points));
  for (const PointPrompt& point : points) query.positive.push_back(point.positive ? 1 : 0);
  MaskGrid grid(kThresholds);
  for (int k = 0; k < kNumScales; ++k) {
    ASSIGN_OR_RETURN(const std::vector<float> similarities,
                     segmenter.Similarity(query.features, ScaleAt(k), view));
    grid.AddScale(BestOf(points, true, similarities), BestOf(points, false, similarities));
  }
  std::vector<ScaleProposal> proposals;
  for (const MaskGrid::Plateau& plateau : grid.FindPlateaus(kMinArea, max_count)) {
    query.scale = ScaleAt(plateau.cell.scale);
    query.threshold = double{kThresholds[plateau.cell.threshold]};
    ASSIGN_OR_RETURN(std::vector<SegmentResult> results, segmenter.Segment(query, {&view, 1}));
    proposals.push_back({std::move(results[0]), plateau.stability, plateau.support});
  }
  return proposals;
}

}  // namespace pepeseg
