#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/choose_granularity.h"
#include "core/prompt/feature_clusters.h"
#include "core/prompt/fit_prompt.h"
#include "core/prompt/levels.h"
#include "core/query/check_prompt.h"
#include "core/render/feature_norm.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxMaskSamples = 512;  // pixels under the mask whose features are looked at
constexpr int kMaxClusters = 4;
constexpr double kClusterCost = 0.02;  // IoU that each further cluster must bring: few carry over
constexpr double kMinShare = 0.1;      // of the samples, for a cluster to count

// What the small view shows of the mask: its pixels' centres.
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

// Evenly drawn from the pixels that are set.
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

// Without those on which hardly anything was rendered.
std::vector<float> LongFeatures(std::span<const float> features) {
  std::vector<float> kept;
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    if (FeatureNorm(&features[i]) < double{kMinPixelNorm}) continue;
    kept.insert(kept.end(), features.begin() + static_cast<int64_t>(i),
                features.begin() + static_cast<int64_t>(i) + kFeatureSize);
  }
  return kept;
}

// The threshold at which what is over it is most like the mask; of equal ones the lowest.
struct Fit {
  double iou = -1;
  float threshold = 0;
};
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

// Looks for the best fit of features as 1 to kMaxClusters clusters at a scale.
class MaskFitter {
 public:
  MaskFitter(const Segmenter& segmenter, const SmallView& small, std::vector<uint8_t> mask,
             std::span<const float> features)
      : segmenter_(segmenter), view_(small.view), mask_(std::move(mask)) {
    for (int count = 1; count <= kMaxClusters; ++count) {
      std::vector<float> set = ClusterDirections(features, count, kMinShare);
      if (set.empty()) continue;
      // The largest alone: what the mask took in by mistake is in the others.
      if (count > 1) sets_.emplace_back(set.begin(), set.begin() + kFeatureSize);
      const bool known = count > 1 && set.size() == num_values_of_last_;
      num_values_of_last_ = set.size();
      if (!known) sets_.push_back(std::move(set));
    }
  }

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

absl::StatusOr<Query> FitMask(const Segmenter& segmenter, const ModelView& view,
                              const BinaryMask& mask, const Granularity& granularity) {
  RETURN_IF_ERROR(CheckMask(view, mask));
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
