#include "core/features/gaussian_coverage.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "core/base/behind.h"
#include "core/features/mask_scales.h"
#include "core/render/renderer.h"

namespace pepeseg {
namespace {

constexpr double kMaxCellsOfView = 16'384;  // pixels that are looked at in a view, on a grid
constexpr double kMaxCoverage = 0.1;        // of a background pixel, see Coverage
constexpr double kMinAlpha = 0.5;           // of a pixel whose coverage is known

// Cell 0 of a MaskSet is covered by no mask.
bool IsCovered(const MaskSet& masks, int32_t pixel) { return masks.pixel_cell[pixel] != 0; }

// Measures which share of each Gaussian lies under masks, over all views: the blending weights in
// covered pixels, divided by those in all pixels.
class Coverage {
 public:
  explicit Coverage(int64_t num_gaussians)
      : covered_(static_cast<size_t>(num_gaussians)), seen_(static_cast<size_t>(num_gaussians)) {}

  // Adds the pixels of a view. rows: their blend rows.
  void Add(const MaskSet& masks, std::span<const int32_t> pixels, const PixelRows& rows) {
    for (size_t i = 0; i < rows.num_rows(); ++i) {
      const bool covered = IsCovered(masks, pixels[i]);
      for (int32_t e = rows.first[i]; e < rows.first[i + 1]; ++e) {
        seen_[rows.gaussian[e]] += rows.weight[e];
        if (covered) covered_[rows.gaussian[e]] += rows.weight[e];
      }
    }
  }

  // Returns the share of a pixel, in [0, 1]: the mean over the Gaussians blended there, by weight.
  // None where alpha is at most kMinAlpha.
  std::optional<double> OfRow(const PixelRows& rows, size_t row) const {
    double sum = 0, alpha = 0;
    for (int32_t e = rows.first[row]; e < rows.first[row + 1]; ++e) {
      const int32_t gaussian = rows.gaussian[e];
      alpha += double{rows.weight[e]};
      // A Gaussian that the sampled pixels of no view show counts as uncovered.
      if (seen_[gaussian] > 0) {
        sum += double{rows.weight[e]} * double{covered_[gaussian]} / double{seen_[gaussian]};
      }
    }
    if (alpha <= kMinAlpha) return std::nullopt;
    return sum / alpha;
  }

 private:
  std::vector<float> covered_, seen_;  // [num_gaussians] sums of blend weights
};

// Returns the rows of these numbers.
PixelRows RowsOf(const PixelRows& rows, std::span<const size_t> numbers) {
  PixelRows chosen;
  chosen.first.push_back(0);
  for (const size_t row : numbers) {
    const auto begin = rows.first[row], end = rows.first[row + 1];
    chosen.gaussian.insert(chosen.gaussian.end(), rows.gaussian.begin() + begin,
                           rows.gaussian.begin() + end);
    chosen.weight.insert(chosen.weight.end(), rows.weight.begin() + begin,
                         rows.weight.begin() + end);
    chosen.first.push_back(static_cast<int32_t>(chosen.gaussian.size()));
  }
  return chosen;
}

// The grid pixels of a view that lie under no mask.
struct UncoveredGrid {
  std::vector<int32_t> pixels;
  std::optional<PixelRows> rows;  // if there was room
};

// keep_rows: there is room for them.
UncoveredGrid UncoveredOf(const MaskSet& masks, std::span<const int32_t> pixels,
                          const PixelRows& rows, bool keep_rows) {
  UncoveredGrid grid;
  std::vector<size_t> numbers;
  for (size_t i = 0; i < rows.num_rows(); ++i) {
    if (IsCovered(masks, pixels[i])) continue;
    grid.pixels.push_back(pixels[i]);
    numbers.push_back(i);
  }
  if (keep_rows) grid.rows = RowsOf(rows, numbers);
  return grid;
}

constexpr size_t kMaxViews = 64;      // views that are looked at
constexpr double kMaxCells = 32'768;  // pixels that are looked at in a view, on a grid
// Sum of a Gaussian's blending weights over these pixels above which the view shows it.
constexpr float kMinWeight = 0.01f;
constexpr float kMinViewShare = 1.0f / 6;  // of the views that are looked at: see FeatureConfidence
constexpr float kOfUnseen = 0.005f;        // smallest confidence

// Returns up to kMaxViews of the views that stage two learns from, spread evenly.
std::vector<const View*> SomeTrained(const Capture& capture) {
  std::vector<const View*> all;
  for (const View& view : capture.views) {
    if (IsTrained(view)) all.push_back(&view);
  }
  const size_t num = std::min(kMaxViews, all.size());
  std::vector<const View*> some;
  for (size_t k = 0; k < num; ++k) some.push_back(all[k * all.size() / num]);
  return some;
}

}  // namespace

std::vector<UncoveredPixels> FindUncovered(const Capture& capture,
                                           std::span<const MaskSet* const> masks, Renderer& scene) {
  // All views are needed before the first pixel can be judged.
  Coverage coverage(scene.num_gaussians());
  std::vector<UncoveredGrid> uncovered(capture.views.size());
  size_t num_kept = 0;
  Behind behind;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const View& view = capture.views[v];
    if (!IsTrained(view)) continue;
    std::vector<int32_t> pixels = KnownGridPixels(view, kMaxCellsOfView);
    PixelRows rows = ToHost(scene.Rows(view, pixels));
    behind.Do([&, v, pixels = std::move(pixels), rows = std::move(rows)] {
      coverage.Add(*masks[v], pixels, rows);
      uncovered[v] = UncoveredOf(*masks[v], pixels, rows, num_kept < kMaxKeptEntries);
      if (uncovered[v].rows) num_kept += uncovered[v].rows->gaussian.size();
    });
  }
  behind.Wait();
  std::vector<UncoveredPixels> found(capture.views.size());
  for (size_t v = 0; v < capture.views.size(); ++v) {
    UncoveredGrid& grid = uncovered[v];
    if (grid.pixels.empty()) continue;
    const PixelRows rows =
        grid.rows ? *std::move(grid.rows) : ToHost(scene.Rows(capture.views[v], grid.pixels));
    for (size_t i = 0; i < rows.num_rows(); ++i) {
      const std::optional<double> covered = coverage.OfRow(rows, i);
      if (!covered) continue;
      (*covered < kMaxCoverage ? found[v].background : found[v].covered_elsewhere)
          .push_back(grid.pixels[i]);
    }
  }
  return found;
}

std::vector<float> FeatureConfidence(const Capture& capture, Renderer& scene,
                                     int min_confident_views) {
  const auto count = static_cast<size_t>(scene.num_gaussians());
  const std::vector<const View*> views = SomeTrained(capture);
  const auto num_looked_at = static_cast<float>(views.size());
  const float num_required =
      std::max({1.0f, std::min(static_cast<float>(min_confident_views), num_looked_at),
                kMinViewShare * num_looked_at});
  std::vector<int> num_views(count);
  std::vector<float> weight(count);
  Behind behind;
  for (const View* view : views) {
    PixelRows rows = ToHost(scene.Rows(*view, KnownGridPixels(*view, kMaxCells)));
    behind.Do([&, rows = std::move(rows)] {
      std::ranges::fill(weight, 0.0f);
      for (size_t e = 0; e < rows.gaussian.size(); ++e) weight[rows.gaussian[e]] += rows.weight[e];
      for (size_t i = 0; i < count; ++i) num_views[i] += weight[i] > kMinWeight ? 1 : 0;
    });
  }
  behind.Wait();
  std::vector<float> confidence(count);
  std::ranges::transform(num_views, confidence.begin(), [&](int num) {
    const float share = static_cast<float>(num) / num_required;
    return std::clamp(share * share, kOfUnseen, 1.0f);
  });
  return confidence;
}

}  // namespace pepeseg
