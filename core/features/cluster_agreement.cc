#include "core/features/cluster_agreement.h"

#include <algorithm>
#include <vector>

#include "core/features/masks_of_patch.h"
#include "core/features/scale_labels.h"

namespace pepeseg {
namespace {

// Of each cluster, how many of its pixels have a label, and how many each mask holds.
struct Votes {
  Votes(int num_clusters, int num_masks)
      : num_masks_(num_masks),
        labelled_(num_clusters),
        held_(static_cast<size_t>(num_clusters) * num_masks) {}

  void Add(int cluster, std::span<const uint64_t> labels) {
    bool any = false;
    ForEachMaskIn(labels, [&](int mask) {
      ++held_[static_cast<size_t>(cluster) * num_masks_ + mask];
      any = true;
    });
    if (any) ++labelled_[cluster];
  }
  bool Agree(int cluster) const {
    const auto first = held_.begin() + static_cast<int64_t>(cluster) * num_masks_;
    const int most = *std::max_element(first, first + num_masks_);
    return most >= kMinAgreement * labelled_[cluster];
  }

 private:
  int num_masks_;
  std::vector<int> labelled_;  // [clusters]
  std::vector<int> held_;      // [clusters, masks]
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
  std::vector<int> number(clusters.count, kNoise);
  for (int c = 0; c < clusters.count; ++c) {
    if (votes.Agree(c)) number[c] = kept.count++;
  }
  for (int& label : kept.labels) label = label == kNoise ? kNoise : number[label];
  return kept;
}

}  // namespace pepeseg
