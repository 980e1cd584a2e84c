#include "core/evaluate/mask_scores.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <utility>

namespace pepeseg {
namespace {

constexpr double kBoundaryShare = 0.02;  // boundary width as a fraction of the diagonal

// Returns count choose 2.
double Pairs(int64_t count) {
  return 0.5 * static_cast<double>(count) * static_cast<double>(count - 1);
}

// Returns how many pairs of elements share a part, from the sizes of the parts.
template <class Key>
double PairsInside(const std::map<Key, int64_t>& sizes) {
  double pairs = 0;
  for (const auto& [key, size] : sizes) pairs += Pairs(size);
  return pairs;
}

}  // namespace

double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore) {
  assert(prediction.size() == truth.size());
  assert(ignore.empty() || ignore.size() == truth.size());
  int64_t both = 0, either = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (!ignore.empty() && ignore[i] != 0) continue;
    both += prediction[i] != 0 && truth[i] != 0;
    either += prediction[i] != 0 || truth[i] != 0;
  }
  return either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
}

double PixelAccuracy(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
                     std::span<const uint8_t> ignore) {
  assert(prediction.size() == truth.size());
  int64_t right = 0, all = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (!ignore.empty() && ignore[i] != 0) continue;
    right += (prediction[i] != 0) == (truth[i] != 0);
    ++all;
  }
  return all == 0 ? 1.0 : static_cast<double>(right) / static_cast<double>(all);
}

std::vector<double> IouByThreshold(std::span<const float> similarity, std::span<const uint8_t> mask,
                                   std::span<const uint8_t> truth, std::span<const uint8_t> ignore,
                                   std::span<const double> thresholds) {
  assert(similarity.size() == truth.size());
  assert(mask.empty() || mask.size() == truth.size());
  const std::vector<float> edges(thresholds.begin(), thresholds.end());
  // [i]: number of pixels over exactly the first i thresholds, outside and inside the truth.
  std::vector<std::array<int64_t, 2>> over(edges.size() + 1);
  for (size_t pixel = 0; pixel < similarity.size(); ++pixel) {
    if (!ignore.empty() && ignore[pixel] != 0) continue;
    size_t bin = 0;
    if (mask.empty() || mask[pixel] != 0) {
      while (bin < edges.size() && similarity[pixel] > edges[bin]) ++bin;
    }
    ++over[bin][truth[pixel] != 0 ? 1 : 0];
  }
  int64_t num_inside = 0;
  for (const auto& bin : over) num_inside += bin[1];
  std::vector<double> ious(edges.size());
  int64_t both = 0, outside = 0;
  for (size_t i = edges.size(); i > 0; --i) {
    outside += over[i][0];
    both += over[i][1];
    const int64_t either = num_inside + outside;
    ious[i - 1] = either == 0 ? 1.0 : static_cast<double>(both) / static_cast<double>(either);
  }
  return ious;
}

int BoundaryWidth(int width, int height) {
  return std::max(1, static_cast<int>(std::lround(kBoundaryShare * std::hypot(width, height))));
}

// A pixel survives the erosions if its whole window of side 2 * distance + 1 is in the mask. The
// window is separable: find the centres of runs of that length along the scanlines, then runs of
// such centres along the columns.
std::vector<uint8_t> MaskBoundary(std::span<const uint8_t> mask, int width, int height,
                                  int distance) {
  assert(mask.size() == static_cast<size_t>(width) * height);
  const int window = 2 * distance + 1;
  std::vector<uint8_t> boundary(mask.size());
  std::vector<uint8_t> middle(width);      // 1: centre of a run in this scanline
  std::vector<int32_t> column_run(width);  // length of the run of centres that ends here
  for (int y = 0; y < height; ++y) {
    const size_t row = static_cast<size_t>(y) * width;
    std::fill(middle.begin(), middle.end(), uint8_t{0});
    for (int x = 0, run = 0; x < width; ++x) {
      const bool inside = mask[row + x] != 0;
      boundary[row + x] = inside ? 1 : 0;
      run = inside ? run + 1 : 0;
      if (run >= window) middle[x - distance] = 1;
    }
    for (int x = 0; x < width; ++x) {
      column_run[x] = middle[x] != 0 ? column_run[x] + 1 : 0;
      if (column_run[x] >= window) boundary[row - static_cast<size_t>(distance) * width + x] = 0;
    }
  }
  return boundary;
}

double BoundaryIou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                   int height, std::span<const uint8_t> ignore) {
  const int distance = BoundaryWidth(width, height);
  std::vector<uint8_t> counted(prediction.begin(), prediction.end());
  for (size_t i = 0; i < ignore.size(); ++i) {
    if (ignore[i] != 0) counted[i] = truth[i];
  }
  return Iou(MaskBoundary(counted, width, height, distance),
             MaskBoundary(truth, width, height, distance), ignore);
}

MaskScores ScoreMask(std::span<const uint8_t> prediction, std::span<const uint8_t> truth, int width,
                     int height, std::span<const uint8_t> ignore) {
  return {Iou(prediction, truth, ignore), PixelAccuracy(prediction, truth, ignore),
          BoundaryIou(prediction, truth, width, height, ignore)};
}

MaskScores MeanOf(std::span<const MaskScores> scores) {
  MaskScores mean;
  if (scores.empty()) return mean;
  for (const MaskScores& score : scores) {
    mean.iou += score.iou;
    mean.accuracy += score.accuracy;
    mean.boundary_iou += score.boundary_iou;
  }
  const auto count = static_cast<double>(scores.size());
  return {mean.iou / count, mean.accuracy / count, mean.boundary_iou / count};
}

double AdjustedRand(std::span<const int32_t> a, std::span<const int32_t> b) {
  assert(a.size() == b.size());
  std::map<int32_t, int64_t> of_a, of_b;
  std::map<std::pair<int32_t, int32_t>, int64_t> of_both;
  for (size_t i = 0; i < a.size(); ++i) {
    ++of_a[a[i]];
    ++of_b[b[i]];
    ++of_both[{a[i], b[i]}];
  }
  const double together = PairsInside(of_both);
  const double in_a = PairsInside(of_a), in_b = PairsInside(of_b);
  const double all = Pairs(static_cast<int64_t>(a.size()));
  const double by_chance = all > 0 ? in_a * in_b / all : 0;
  const double most = 0.5 * (in_a + in_b);
  return most == by_chance ? 1 : (together - by_chance) / (most - by_chance);
}

}  // namespace pepeseg
