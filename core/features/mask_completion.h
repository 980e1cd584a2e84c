#pragma once

#include <span>
#include <vector>

#include "core/features/mask_agreement.h"
#include "core/features/near_views.h"
#include "core/scene/capture.h"

namespace pepeseg {

// MaskQuality below which masks are completed. Masks that agree better have little to add.
inline constexpr double kCompleteBelow = 0.65;

// The masks of a view with those that it lacked, added by a vote of the near views.
struct CompletedMasks {
  // The view's own masks in their order, then the added ones. Empty if none was added.
  MaskSet masks;
  std::vector<float> added_scales;  // of the added masks, scene units
};

// Returns the completed masks, by view of the capture (METHOD.md section 2, "Masks that disagree").
// A mask is added to a view if the view has no mask of a surface, at least two near views and at
// least half of all views that see the surface (this view is one of them) hold it as one mask, and
// other views agree with these masks. A pixel is under the added mask if more than half of the near
// views that know it have it under theirs. The scale is the median of their scales.
//
// mask_scales: by view and mask, scene units. Masks without a scale are not added to other views.
// Uses all cores of the machine. Views in which an own mask covers no pixel are left as they are.
std::vector<CompletedMasks> CompleteMasks(const Capture& capture, const Reprojection& reprojection,
                                          const MaskAgreements& agreements,
                                          std::span<const std::vector<float>> mask_scales);

}  // namespace pepeseg
