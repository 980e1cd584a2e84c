#include "core/features/cross_view.h"

#include <algorithm>
#include <cmath>

#include "core/features/mask_scales.h"

namespace pepeseg {
namespace {

// Returns the finest mask that is not smaller than `scale`, or -1. masks: by scale, ascending.
template <class Masks>
int32_t FinestFrom(const Masks& masks, float scale) {
  for (const auto& at : masks) {
    if (at.scale >= scale) return at.mask;
  }
  return -1;
}

}  // namespace

CrossView::CrossView(const Reprojection& reprojection, const std::vector<DrawableView>& views)
    : reprojection_(reprojection) {
  for (const DrawableView& drawn : views) {
    const MaskSet& masks = *drawn.masks;
    if (seen_.size() <= static_cast<size_t>(drawn.view)) seen_.resize(drawn.view + 1);
    Seen& seen = seen_[drawn.view];
    seen.masks = &masks;
    for (int patch = 0; patch < masks.num_patches(); ++patch) {
      std::vector<MaskAt>& of_patch = seen.patch_masks.emplace_back();
      ForEachMaskIn(PatchBits(masks, patch), [&](int mask) {
        if (drawn.mask_scales[mask] > kNoScale) of_patch.push_back({mask, drawn.mask_scales[mask]});
      });
      // Ascending scales for FinestFrom. Stable: of masks with equal scales the first counts as the
      // finest, as in ScaleLabels.
      std::stable_sort(of_patch.begin(), of_patch.end(),
                       [](const MaskAt& a, const MaskAt& b) { return a.scale < b.scale; });
    }
  }
}

CrossView::Sight CrossView::Look(int number, int32_t pixel) const {
  Sight sight;
  sight.fill(kUnknown);
  const std::span<const int> near = reprojection_.near(number);
  const Reprojection::Sight pixels = reprojection_.Look(number, pixel);
  for (size_t i = 0; i < near.size(); ++i) {
    const auto other = static_cast<size_t>(near[i]);
    if (pixels[i] == Reprojection::kUnknown || other >= seen_.size()) continue;
    if (seen_[other].masks == nullptr) continue;
    sight[i] = static_cast<int32_t>(seen_[other].masks->pixel_patch[pixels[i]]);
  }
  return sight;
}

// Computes G without building the labels of ScaleLabels: two cells share a label if they share a
// mask below the scale, or if the finest mask from the scale on is the same.
uint32_t CrossView::Agreements(std::span<const MaskAt> a, std::span<const MaskAt> b,
                               std::span<const float> scales) {
  float finest_common = INFINITY;
  for (const MaskAt& of_a : a) {
    for (const MaskAt& of_b : b) {
      if (of_a.mask == of_b.mask) finest_common = std::min(finest_common, of_a.scale);
    }
  }
  uint32_t agrees = 0;
  for (size_t k = 0; k < scales.size(); ++k) {
    const int32_t finest = FinestFrom(a, scales[k]);
    if (finest_common < scales[k] || (finest >= 0 && finest == FinestFrom(b, scales[k]))) {
      agrees |= 1u << k;
    }
  }
  return agrees;
}

CrossView::Verdict CrossView::Judge(int view, const Sight& a, const Sight& b,
                                    std::span<const float> scales) const {
  Verdict verdict;
  // Bit k of all bitsets stands for scales[k]; kMaxScales is 16.
  const uint32_t all = (1u << scales.size()) - 1u;
  const std::span<const int> near = reprojection_.near(view);
  for (size_t i = 0; i < near.size(); ++i) {
    if (a[i] == kUnknown || b[i] == kUnknown) continue;
    const std::vector<MaskAt>&of_a = seen_[near[i]].patch_masks[a[i]],
          &of_b = seen_[near[i]].patch_masks[b[i]];
    // Where neither pixel is under a mask the view has no opinion. Where only one is, it says apart
    // at each scale. Views may contradict each other: then both bits are set.
    if (of_a.empty() && of_b.empty()) continue;
    const uint32_t agrees = Agreements(of_a, of_b, scales);
    verdict.together |= agrees;
    verdict.apart |= all & ~agrees;
  }
  return verdict;
}

}  // namespace pepeseg
