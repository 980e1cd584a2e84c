#include "core/features/centroid_bank.h"

#include <algorithm>
#include <cmath>

#include "core/features/mask_scales.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr float kMovedShare = 0.1f;  // of the way from a centroid to the mean of its cluster

double Dot(const float* a, const float* b) {
  double sum = 0;
  for (int k = 0; k < kFeatureSize; ++k) sum += double{a[k]} * b[k];
  return sum;
}

// Counts the pixels of each cluster that have a label, and those whose label has a given mask.
class Votes {
 public:
  Votes(int num_clusters, int num_masks)
      : num_masks_(num_masks),
        labelled_(num_clusters),
        held_(static_cast<size_t>(num_clusters) * num_masks) {}

  // labels: of one pixel of the cluster, see ScaleLabels.
  void Add(int cluster, std::span<const uint64_t> labels) {
    bool any = false;
    ForEachMaskIn(labels, [&](int mask) {
      ++held_[static_cast<size_t>(cluster) * num_masks_ + mask];
      any = true;
    });
    if (any) ++labelled_[cluster];
  }

  // Returns whether one mask holds enough of the cluster's labelled pixels.
  bool Agree(int cluster) const {
    // A cluster without a labelled pixel agrees: 0 >= 0.
    const auto first = held_.begin() + static_cast<int64_t>(cluster) * num_masks_;
    const int most = *std::max_element(first, first + num_masks_);
    return most >= kMinAgreement * labelled_[cluster];
  }

 private:
  int num_masks_;
  std::vector<int> labelled_;  // [clusters] pixels
  std::vector<int> held_;      // [clusters, masks] pixels
};

}  // namespace

Clusters KeepAgreeing(const Clusters& clusters, const MaskSet& masks,
                      std::span<const int32_t> pixels, std::span<const float> mask_scales,
                      float scale) {
  if (clusters.count == 0 || masks.empty()) return clusters;
  Votes votes(clusters.count, masks.num_masks);
  std::vector<uint64_t> labels(masks.words);
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (clusters.labels[i] == kNoise) continue;
    const uint32_t patch = masks.pixel_patch[pixels[i]];
    ScaleLabels(PatchBits(masks, patch), mask_scales, scale, labels);
    votes.Add(clusters.labels[i], labels);
  }
  Clusters kept = clusters;
  kept.count = 0;
  std::vector<int> number(clusters.count, kNoise);  // after dropped clusters are gone
  for (int c = 0; c < clusters.count; ++c) {
    if (votes.Agree(c)) number[c] = kept.count++;
  }
  for (int& label : kept.labels) label = label == kNoise ? kNoise : number[label];
  return kept;
}

void CentroidBank::Merge(std::span<const float> means) {
  // New centroids of this call are not compared with its other means. Means have length 1, so that
  // Dot is the cosine.
  const size_t num_known = centroids_.size();  // floats; the centroids before this call
  for (size_t i = 0; i < means.size(); i += kFeatureSize) {
    const float* mean = means.data() + i;
    double best = double{merge_cosine_};
    float* nearest = nullptr;
    for (size_t k = 0; k < num_known; k += kFeatureSize) {
      const double cosine = Dot(mean, centroids_.data() + k);
      if (cosine <= best) continue;
      best = cosine;
      nearest = centroids_.data() + k;
    }
    if (nearest == nullptr) {
      centroids_.insert(centroids_.end(), mean, mean + kFeatureSize);
      continue;
    }
    for (int k = 0; k < kFeatureSize; ++k) nearest[k] += kMovedShare * (mean[k] - nearest[k]);
    // Back to length 1, which the next comparisons and the loss rely on.
    const auto inv_length = static_cast<float>(1 / std::sqrt(Dot(nearest, nearest)));
    for (int k = 0; k < kFeatureSize; ++k) nearest[k] *= inv_length;
  }
}

}  // namespace pepeseg
