#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/query/resolve_prompt.h"
#include "core/render/feature_maps.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxMaskSamples = 512;  // maximum number of pixels under the mask to sample
constexpr int kMaxClusters = 4;
constexpr double kClusterCost = 0.02;  // minimum IoU gain per further cluster: few clusters carry
                                       // over to other views better
constexpr int kNumRounds = 5;          // of Lloyd's algorithm
constexpr double kMinShare = 0.1;      // minimum share of the samples in a cluster

// Returns the inner product of two features.
float Dot(const float* a, const float* b) {
  return std::inner_product(a, a + kFeatureSize, b, 0.0f);
}

// Scales a feature to length 1; leaves 0 as it is.
void Normalise(float* row) {
  const float norm = std::sqrt(Dot(row, row));
  if (norm <= 0) return;
  for (int k = 0; k < kFeatureSize; ++k) row[k] /= norm;
}

struct Nearest {
  size_t center = 0;
  float cosine = -2;
};
// Returns the centre with the largest cosine to a unit feature.
Nearest NearestOf(const float* unit, std::span<const float> centers) {
  Nearest best;
  for (size_t c = 0; c * kFeatureSize < centers.size(); ++c) {
    const float cosine = Dot(unit, &centers[c * kFeatureSize]);
    if (cosine > best.cosine) best = {c, cosine};
  }
  return best;
}

std::vector<float> MeanOf(std::span<const float> units) {
  std::vector<float> mean(kFeatureSize);
  for (size_t i = 0; i < units.size(); ++i) mean[i % kFeatureSize] += units[i];
  Normalise(mean.data());
  return mean;
}

// Returns the mean of the features, and `count` - 1 times the feature farthest from all centres so
// far.
std::vector<float> FirstCenters(std::span<const float> units, int count) {
  std::vector<float> centers = MeanOf(units);
  for (int c = 1; c < count; ++c) {
    size_t farthest = 0;
    float least = 2;
    for (size_t i = 0; i < units.size(); i += kFeatureSize) {
      const float cosine = NearestOf(&units[i], centers).cosine;
      if (cosine < least) least = cosine, farthest = i;
    }
    const auto first = units.begin() + static_cast<int64_t>(farthest);
    centers.insert(centers.end(), first, first + kFeatureSize);
  }
  return centers;
}

// Moves each centre to the mean of the features nearest to it. Returns their number for each
// centre.
std::vector<int> MoveCenters(std::span<const float> units, std::vector<float>& centers) {
  std::vector<float> sums(centers.size());
  std::vector<int> sizes(centers.size() / kFeatureSize);
  for (size_t i = 0; i < units.size(); i += kFeatureSize) {
    const size_t c = NearestOf(&units[i], centers).center;
    for (int k = 0; k < kFeatureSize; ++k) sums[c * kFeatureSize + k] += units[i + k];
    ++sizes[c];
  }
  for (size_t c = 0; c < sizes.size(); ++c) {
    if (sizes[c] == 0) continue;
    Normalise(&sums[c * kFeatureSize]);
    std::copy_n(&sums[c * kFeatureSize], kFeatureSize, &centers[c * kFeatureSize]);
  }
  return sizes;
}

// Returns the mask in the small view, sampled at the centres of its pixels.
std::vector<uint8_t> Shrunk(const BinaryMask& mask, int width, const SmallView& small) {
  const Camera& camera = small.view.camera;
  std::vector<uint8_t> shrunk;
  shrunk.reserve(static_cast<size_t>(camera.width) * camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const size_t from = static_cast<size_t>(y * small.factor + small.factor / 2) * width +
                          x * small.factor + small.factor / 2;
      shrunk.push_back(mask.pixels[from] != 0 ? 1 : 0);
    }
  }
  return shrunk;
}

// Returns at most kMaxMaskSamples of the mask's pixels, evenly spread in reading order.
std::vector<int32_t> SamplesOf(std::span<const uint8_t> mask) {
  std::vector<int32_t> inside;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) inside.push_back(static_cast<int32_t>(i));
  }
  if (inside.size() <= kMaxMaskSamples) return inside;
  std::vector<int32_t> samples;
  samples.reserve(kMaxMaskSamples);
  for (size_t i = 0; i < kMaxMaskSamples; ++i)
    samples.push_back(inside[i * inside.size() / kMaxMaskSamples]);
  return samples;
}

// Returns the features without those of pixels on which hardly anything was rendered.
std::vector<float> LongFeatures(std::span<const float> features) {
  std::vector<float> kept;
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    if (FeatureNorm(&features[i]) < double{kMinPixelNorm}) continue;
    kept.insert(kept.end(), features.begin() + static_cast<int64_t>(i),
                features.begin() + static_cast<int64_t>(i) + kFeatureSize);
  }
  return kept;
}

// A threshold, and the IoU of the mask and the pixels over it.
struct Fit {
  double iou = -1;
  float threshold = 0;
};
// Returns the threshold with the best IoU, the lowest one among equals.
Fit BestThreshold(std::span<const float> similarity, std::span<const uint8_t> mask,
                  std::span<const float> thresholds) {
  std::vector<int64_t> all(thresholds.size() + 1), inside(thresholds.size() + 1);
  const std::vector<uint8_t> levels = LevelsOf(similarity, thresholds);
  int64_t area = 0;
  for (size_t i = 0; i < levels.size(); ++i) {
    ++all[levels[i]];
    if (mask[i] != 0) ++inside[levels[i]], ++area;
  }
  Fit best;
  int64_t num_all = 0, both = 0;
  for (size_t t = thresholds.size(); t > 0; --t) {
    num_all += all[t], both += inside[t];
    const double iou = static_cast<double>(both) / static_cast<double>(num_all + area - both);
    if (iou >= best.iou) best = {iou, thresholds[t - 1]};
  }
  return best;
}

// Searches for the set of clusters, scale and threshold whose mask fits best. The features under
// the mask are clustered into 1 to kMaxClusters clusters; each clustering is tried whole, and by
// its largest cluster alone.
class MaskFitter {
 public:
  MaskFitter(const Segmenter& segmenter, const SmallView& small, std::vector<uint8_t> mask,
             std::span<const float> features)
      : segmenter_(segmenter), view_(small.view), mask_(std::move(mask)) {
    for (int count = 1; count <= kMaxClusters; ++count) {
      std::vector<float> set = ClusterDirections(features, count, kMinShare);
      if (set.empty()) continue;
      // The largest cluster alone: the others may hold what the mask covers by mistake.
      if (count > 1) sets_.emplace_back(set.begin(), set.begin() + kFeatureSize);
      const bool known = count > 1 && set.size() == num_values_of_last_;
      num_values_of_last_ = set.size();
      if (!known) sets_.push_back(std::move(set));
    }
  }

  // Tries every set of clusters at this scale and keeps the best fit so far.
  absl::Status LookAt(double scale, std::span<const float> thresholds) {
    for (const std::vector<float>& set : sets_) {
      ASSIGN_OR_RETURN(std::vector<float> similarities, segmenter_.Similarity(set, scale, view_));
      const size_t num_pixels = mask_.size();
      for (size_t i = num_pixels; i < similarities.size(); ++i) {
        similarities[i % num_pixels] = std::max(similarities[i % num_pixels], similarities[i]);
      }
      similarities.resize(num_pixels);
      const Fit fit = BestThreshold(similarities, mask_, thresholds);
      const size_t num_further = set.size() / kFeatureSize - 1;
      const double score = fit.iou - kClusterCost * static_cast<double>(num_further);
      if (score <= best_score_) continue;
      best_score_ = score;
      best_ = {set, std::vector<uint8_t>(set.size() / kFeatureSize, 1), scale,
               double{fit.threshold}};
    }
    return absl::OkStatus();
  }
  const Query& best() const { return best_; }

 private:
  const Segmenter& segmenter_;
  const ModelView& view_;
  const std::vector<uint8_t> mask_;
  std::vector<std::vector<float>> sets_;
  size_t num_values_of_last_ = 0;
  double best_score_ = -1;
  Query best_;
};

}  // namespace

// Starts from the mean and the farthest features, then runs kNumRounds of Lloyd's algorithm on unit
// vectors.
std::vector<float> ClusterDirections(std::span<const float> features, int count, double min_share) {
  std::vector<float> units(features.begin(), features.end());
  for (size_t i = 0; i < units.size(); i += kFeatureSize) Normalise(&units[i]);
  std::vector<float> centers = FirstCenters(units, count);
  std::vector<int> sizes;
  for (int round = 0; round < kNumRounds; ++round) sizes = MoveCenters(units, centers);
  std::vector<size_t> order(sizes.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return sizes[a] > sizes[b]; });
  const size_t num_features = units.size() / kFeatureSize;
  const double least = min_share * static_cast<double>(num_features);
  std::vector<float> kept;
  for (const size_t c : order) {
    if (sizes[c] < least || sizes[c] == 0) continue;
    const auto first = centers.begin() + static_cast<int64_t>(c) * kFeatureSize;
    kept.insert(kept.end(), first, first + kFeatureSize);
  }
  return kept;
}

absl::StatusOr<Query> FitMask(const Segmenter& segmenter, const ModelView& view,
                              const BinaryMask& mask, const Granularity& granularity) {
  RETURN_IF_ERROR(CheckView(view));
  RETURN_IF_ERROR(CheckMask(ImageOf(view), mask));
  const SmallView small = SmallViewOf(view);
  std::vector<uint8_t> shrunk = Shrunk(mask, view.camera.width, small);
  const std::vector<int32_t> samples = SamplesOf(shrunk);
  std::vector<float> features;
  if (!samples.empty()) {
    ASSIGN_OR_RETURN(features, segmenter.PixelFeatures(small.view, samples));
  }
  features = LongFeatures(features);
  if (features.empty()) {
    return NothingThereError(
        "nothing with a feature is rendered under the mask; does it show an object that a mask "
        "covered in training?");
  }
  MaskFitter fitter(segmenter, small, std::move(shrunk), features);
  const GranularityGrid grid = GridOf(granularity);
  for (const double scale : grid.scales) RETURN_IF_ERROR(fitter.LookAt(scale, grid.thresholds));
  return fitter.best();
}

}  // namespace pepeseg
