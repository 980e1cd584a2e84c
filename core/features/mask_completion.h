#pragma once

#include <span>
#include <vector>

#include "core/features/mask_agreement.h"
#include "core/features/reprojection.h"
#include "core/scene/capture.h"

namespace pepeseg {

// MaskQuality from which a capture's masks are left as they are.
inline constexpr double kCompleteBelow = 0.65;

// The masks of a view with those that it lacks, voted for by the near views.
struct CompletedMasks {
  // The view's own masks in their order, then the added ones. Empty where none was added.
  MaskSet masks;
  std::vector<float> added_scales;  // scene units
};

// By view of the capture. Adds a mask where at least two near views, and at least half of those
// that see the surface (the view itself is one of them), hold a surface as one mask, other views
// agree with these masks, and the view has no mask of that surface. A pixel is under the added mask
// where most of these views have it under theirs. The scale is the median of their scales.
//
// mask_scales: by view and mask; masks without a scale are not added to other views.
std::vector<CompletedMasks> CompleteMasks(const Capture& capture, const Reprojection& reprojection,
                                          const MaskAgreements& agreements,
                                          std::span<const std::vector<float>> mask_scales);

}  // namespace pepeseg
