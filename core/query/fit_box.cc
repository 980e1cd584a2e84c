#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/query/check_prompt.h"
#include "core/query/choose_granularity.h"
#include "core/query/feature_clusters.h"
#include "core/query/fit_prompt.h"
#include "core/status_macros.h"
#include "kernels/ops.h"

namespace pepeseg {
namespace {

constexpr int kSampleSide = 9;        // samples along a side of the box
constexpr double kMiddle = 0.8;       // of the box, where they lie
constexpr double kMinNorm = 0.4;      // see Segmenter: what is shorter is in no mask
constexpr double kSameCosine = 0.95;  // of features that need not both be asked
constexpr size_t kMaxCandidates = 8;
constexpr double kTrimmed = 0.005;  // of a mask's pixels, at each end: strays do not widen its box

// Edges in pixels, clipped to the image.
struct Edges {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  double Area() const { return std::max(0.0, x1 - x0) * std::max(0.0, y1 - y0); }
};

Edges EdgesIn(const BoxPrompt& box, const SmallView& small) {
  const Camera& camera = small.view.camera;
  const double f = small.factor;
  return {std::max(0.0, box.x / f), std::max(0.0, box.y / f),
          std::min<double>(camera.width, (box.x + box.width) / f),
          std::min<double>(camera.height, (box.y + box.height) / f)};
}

double IouOf(const Edges& a, const Edges& b) {
  const Edges both = {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1),
                      std::min(a.y1, b.y1)};
  const double common = both.Area();
  return common == 0 ? 0 : common / (a.Area() + b.Area() - common);
}

// A grid about the middle of the box.
std::vector<int32_t> SamplesIn(const Edges& box, const Camera& camera) {
  std::vector<int32_t> pixels;
  pixels.reserve(kSampleSide * kSampleSide);
  for (int j = 0; j < kSampleSide; ++j) {
    for (int i = 0; i < kSampleSide; ++i) {
      const auto along = [](int k) { return 0.5 + kMiddle * ((k + 0.5) / kSampleSide - 0.5); };
      const auto x = static_cast<int32_t>(box.x0 + along(i) * (box.x1 - box.x0));
      const auto y = static_cast<int32_t>(box.y0 + along(j) * (box.y1 - box.y0));
      pixels.push_back(std::clamp(y, 0, camera.height - 1) * camera.width +
                       std::clamp(x, 0, camera.width - 1));
    }
  }
  return pixels;
}

double CosineOf(const float* a, const float* b) {
  double ab = 0, aa = 0, bb = 0;
  for (int k = 0; k < kFeatureSize; ++k) {
    ab += double{a[k]} * b[k], aa += double{a[k]} * a[k], bb += double{b[k]} * b[k];
  }
  return ab / std::sqrt(std::max(1e-12, aa * bb));
}

// Those that are not nearly the same as one that is more often there; none that is hardly there.
std::vector<float> Candidates(std::span<const float> features) {
  struct Group {
    size_t first;
    int size;
  };
  std::vector<Group> groups;
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    double squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) squares += double{features[i + k]} * features[i + k];
    if (squares < kMinNorm * kMinNorm) continue;
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return CosineOf(&features[group.first], &features[i]) > kSameCosine;
    });
    same == groups.end() ? groups.push_back({i, 1}) : void(++same->size);
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.size > b.size; });
  if (groups.size() > kMaxCandidates) groups.resize(kMaxCandidates);
  std::vector<float> kept;
  kept.reserve(groups.size() * kFeatureSize);
  for (const Group& group : groups) {
    const auto at = features.begin() + static_cast<int64_t>(group.first);
    kept.insert(kept.end(), at, at + kFeatureSize);
  }
  return kept;
}

// Where kTrimmed of `counts` ends, from either side.
std::pair<int, int> Extent(std::span<const int64_t> counts, int64_t total) {
  const auto left_out = static_cast<int64_t>(kTrimmed * static_cast<double>(total));
  int first = 0;
  auto last = static_cast<int>(counts.size());
  for (int64_t sum = counts[first]; sum <= left_out; sum += counts[++first]) {
  }
  for (int64_t sum = counts[last - 1]; sum <= left_out; sum += counts[--last - 1]) {
  }
  return {first, last};
}

// The masks of one feature at one scale by threshold, from the highest, as sums over columns and
// rows.
class BoxFit {
 public:
  BoxFit(const Camera& camera, const Edges& box)
      : box_(box), columns_(camera.width), rows_(camera.height) {}

  void Add(int x, int y) {
    ++columns_[x], ++rows_[y], ++total_;
    const double cx = x + 0.5, cy = y + 0.5;
    if (cx >= box_.x0 && cx < box_.x1 && cy >= box_.y0 && cy < box_.y1) ++inside_;
  }
  double Score() const {
    if (total_ == 0) return 0;
    const auto [x0, x1] = Extent(columns_, total_);
    const auto [y0, y1] = Extent(rows_, total_);
    const Edges own = {double(x0), double(y0), double(x1), double(y1)};
    return IouOf(own, box_) * static_cast<double>(inside_) / static_cast<double>(total_);
  }

 private:
  const Edges box_;
  std::vector<int64_t> columns_, rows_;
  int64_t total_ = 0, inside_ = 0;
};

struct Choice {
  double score = -1;
  size_t feature = 0;
  double scale = 0, threshold = 0;
};

void LookAt(std::span<const float> similarity, const Camera& camera, const Edges& box,
            std::span<const float> thresholds, Choice& choice, Choice at) {
  const std::vector<uint8_t> levels = LevelsOf(similarity, thresholds);
  std::vector<std::vector<int32_t>> of_level(thresholds.size() + 1);
  for (size_t i = 0; i < levels.size(); ++i) {
    if (levels[i] > 0) of_level[levels[i]].push_back(static_cast<int32_t>(i));
  }
  BoxFit fit(camera, box);
  for (size_t t = thresholds.size(); t > 0; --t) {
    for (const int32_t pixel : of_level[t]) fit.Add(pixel % camera.width, pixel / camera.width);
    at.score = fit.Score();
    at.threshold = double{thresholds[t - 1]};
    if (at.score > choice.score) choice = at;
  }
}

}  // namespace

absl::StatusOr<Query> FitBox(const Segmenter& segmenter, const ModelView& view,
                             const BoxPrompt& box, const Granularity& granularity) {
  RETURN_IF_ERROR(CheckBox(view, box));
  const SmallView small = SmallViewOf(view);
  const Camera& camera = small.view.camera;
  const Edges edges = EdgesIn(box, small);
  ASSIGN_OR_RETURN(std::vector<float> features,
                   segmenter.PixelFeatures(small.view, SamplesIn(edges, camera)));
  features = Candidates(features);
  if (features.empty()) {
    return absl::InvalidArgumentError(
        "nothing with a feature is rendered in the box; draw it about an object that a mask "
        "covered "
        "in training");
  }
  const GranularityGrid grid = GridOf(granularity);
  const size_t num_pixels = static_cast<size_t>(camera.width) * camera.height;
  Choice choice;
  for (const double scale : grid.scales) {
    ASSIGN_OR_RETURN(const std::vector<float> similarities,
                     segmenter.Similarity(features, scale, small.view));
    for (size_t i = 0; i * kFeatureSize < features.size(); ++i) {
      LookAt(std::span(similarities).subspan(i * num_pixels, num_pixels), camera, edges,
             grid.thresholds, choice, {0, i, scale, 0});
    }
  }
  const auto first = features.begin() + static_cast<int64_t>(choice.feature) * kFeatureSize;
  return Query{{first, first + kFeatureSize}, {1}, choice.scale, choice.threshold};
}

}  // namespace pepeseg
