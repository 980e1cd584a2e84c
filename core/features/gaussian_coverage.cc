#include "core/features/gaussian_coverage.h"

#include <algorithm>
#include <span>

#include "core/features/mask_scales.h"
#include "core/render/renderer.h"
#include "core/render/weight_sums.h"
#include "kernels/buffer.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

constexpr double kMaxGridPixels = 16'384;  // of a view that are listed as uncovered
constexpr float kMaxCoverage = 0.1f;       // of a background pixel, see UncoveredPixels
constexpr float kMinAlpha = 0.5f;          // of a pixel whose coverage is known

constexpr size_t kMaxViews = 64;  // views that are looked at for the confidence
// A view shows a Gaussian whose blend weights sum to more than kMinWeight on a grid of up to
// kMaxCells of its pixels. The limit on a sum over all pixels is larger in proportion.
constexpr double kMinWeight = 0.01;
constexpr double kMaxCells = 32'768;
constexpr float kMinViewShare = 1.0f / 6;  // of the views that are looked at
constexpr float kOfUnseen = 0.005f;        // smallest confidence

// Cell 0 of a MaskSet is covered by no mask.
bool IsCovered(const MaskSet& masks, int32_t pixel) { return masks.pixel_cell[pixel] != 0; }

// Returns up to kMaxViews of the views, spread evenly.
std::vector<int> SomeOf(std::span<const int> views) {
  const size_t num = std::min(kMaxViews, views.size());
  std::vector<int> some;
  for (size_t k = 0; k < num; ++k) some.push_back(views[k * views.size() / num]);
  return some;
}

// Returns the Gaussians with the colour of degree 0 alone.
Gaussians WithoutShRest(const Gaussians& gaussians) {
  const auto num_values = static_cast<int64_t>(NumPlanes(0)) * gaussians.count;
  return {gaussians.count, 0, {gaussians.planes.begin(), gaussians.planes.begin() + num_values}};
}

// The pixels of a shrunk view over which weights are summed.
enum PixelSet {
  kKnown,    // those that the view does not ignore
  kCovered,  // those of them that are under a mask
  kNumPixelSets
};
// Fills in `sets`, by PixelSet: 1 for the pixels of the set, 0 for the others.
void FindPixels(const View& view, const MaskSet& masks, const WeightView& shrunk,
                std::vector<uint8_t> (&sets)[kNumPixelSets]) {
  const std::vector<int32_t> pixels = shrunk.FullPixels();
  for (std::vector<uint8_t>& set : sets) set.resize(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    const bool known = view.ignore.empty() || view.ignore[pixels[i]] == 0;
    sets[kKnown][i] = known ? 1 : 0;
    sets[kCovered][i] = known && IsCovered(masks, pixels[i]) ? 1 : 0;
  }
}

// Counts the views that show each Gaussian.
class ViewCounts {
 public:
  ViewCounts(Backend& backend, int64_t num_gaussians)
      : of_view_(backend, num_gaussians),
        weight_(static_cast<size_t>(num_gaussians)),
        num_views_(static_cast<size_t>(num_gaussians)) {}

  // Adds a view. sums: measured for it, of kKnown first.
  void Add(const View& view, const WeightView& shrunk, WeightSums& sums) {
    of_view_.Zero();
    sums.AddTo(of_view_.span(), 1);
    of_view_.Download(weight_);
    const auto num_cells = static_cast<double>(GridPixels(view.camera, kMaxCells).size());
    const auto min_weight = static_cast<float>(kMinWeight * shrunk.num_pixels() / num_cells);
    for (size_t i = 0; i < weight_.size(); ++i) num_views_[i] += weight_[i] > min_weight ? 1 : 0;
    ++num_looked_at_;
  }

  std::vector<float> Confidence(int min_confident_views) const {
    const auto num_looked_at = static_cast<float>(num_looked_at_);
    const float num_required =
        std::max({1.0f, std::min(static_cast<float>(min_confident_views), num_looked_at),
                  kMinViewShare * num_looked_at});
    std::vector<float> confidence(num_views_.size());
    std::ranges::transform(num_views_, confidence.begin(), [&](int num) {
      const float share = static_cast<float>(num) / num_required;
      return std::clamp(share * share, kOfUnseen, 1.0f);
    });
    return confidence;
  }

 private:
  Buffer<float> of_view_;       // [num_gaussians] sums of the view that is added
  std::vector<float> weight_;   // the same on the host
  std::vector<int> num_views_;  // [num_gaussians]
  int num_looked_at_ = 0;
};

// Returns the share of each Gaussian under masks, over all views. A Gaussian that no view shows
// counts as uncovered. sums: [kNumPixelSets, num_gaussians].
std::vector<float> CoveredShares(const Buffer<float>& sums, int64_t num_gaussians) {
  std::vector<float> host(static_cast<size_t>(kNumPixelSets * num_gaussians));
  sums.Download(host);
  std::vector<float> shares(static_cast<size_t>(num_gaussians));
  for (size_t i = 0; i < shares.size(); ++i) {
    const float known = host[kKnown * shares.size() + i];
    if (known > 0) shares[i] = std::clamp(host[kCovered * shares.size() + i] / known, 0.0f, 1.0f);
  }
  return shares;
}

// Paints each Gaussian: red is `shares`, green 1, blue 0. In a render, green is then alpha, and red
// over green the mean share over the Gaussians of a pixel, by weight. Wants SH degree 0.
void Paint(std::span<const float> shares, Gaussians& gaussians) {
  const std::span<float> red = gaussians.Plane(kShPlane), green = gaussians.Plane(kShPlane + 1),
                         blue = gaussians.Plane(kShPlane + 2);
  // The colour of degree 0 is 0.5 + kSh0 * coefficient.
  std::ranges::transform(shares, red.begin(), [](float s) { return (s - 0.5f) / kSh0; });
  std::ranges::fill(green, 0.5f / kSh0);
  std::ranges::fill(blue, -0.5f / kSh0);
}

// Returns the uncovered pixels of a view. painted: of Gaussians after Paint.
UncoveredPixels FindUncovered(const View& view, const MaskSet& masks, Renderer& painted) {
  std::vector<int32_t> pixels = KnownGridPixels(view, kMaxGridPixels);
  std::erase_if(pixels, [&](int32_t p) { return IsCovered(masks, p); });
  UncoveredPixels found;
  if (pixels.empty()) return found;
  const WeightView shrunk(view);
  const std::vector<float> colors = painted.HostColorPlanes(shrunk.viewpoint());
  const std::span<const float> red = std::span(colors).first(shrunk.num_pixels()),
                               alpha = std::span(colors).subspan(shrunk.num_pixels());
  for (const int32_t pixel : pixels) {
    const int32_t p = shrunk.PixelAt(pixel);
    if (alpha[p] <= kMinAlpha) continue;
    (red[p] < kMaxCoverage * alpha[p] ? found.background : found.covered_elsewhere)
        .push_back(pixel);
  }
  return found;
}

}  // namespace

GaussianCoverage MeasureCoverage(Backend& backend, const Capture& capture,
                                 std::span<const MaskSet* const> masks, const Gaussians& gaussians,
                                 const CoverageOptions& options) {
  GaussianCoverage coverage;
  const bool find_confidence = options.min_confident_views > 0;
  if (!find_confidence && !options.find_uncovered) return coverage;
  const std::vector<int> trained = TrainedViews(capture), some = SomeOf(trained);
  const double scene_radius = SceneRadius(capture);
  Gaussians plain = WithoutShRest(gaussians);
  std::vector<float> shares;
  {
    // All views are needed before the first pixel can be judged.
    Renderer scene(backend, plain, scene_radius);
    WeightSums sums(scene);
    ViewCounts counts(backend, find_confidence ? gaussians.count : 0);
    Buffer<float> all_views(backend, options.find_uncovered ? kNumPixelSets * gaussians.count : 0);
    std::vector<uint8_t> sets[kNumPixelSets];
    for (const int v : options.find_uncovered ? trained : some) {
      const View& view = capture.views[v];
      const WeightView shrunk(view);
      FindPixels(view, *masks[v], shrunk, sets);
      sums.Measure(shrunk, sets);
      if (options.find_uncovered) sums.AddTo(all_views.span(), kNumPixelSets);
      if (find_confidence && std::ranges::binary_search(some, v)) counts.Add(view, shrunk, sums);
    }
    if (find_confidence) coverage.confidence = counts.Confidence(options.min_confident_views);
    if (!options.find_uncovered) return coverage;
    shares = CoveredShares(all_views, gaussians.count);
  }
  Paint(shares, plain);
  Renderer painted(backend, plain, scene_radius);
  coverage.uncovered.resize(capture.views.size());
  for (const int v : trained) {
    coverage.uncovered[v] = FindUncovered(capture.views[v], *masks[v], painted);
  }
  return coverage;
}

}  // namespace pepeseg
