#pragma once

#include <optional>
#include <vector>

#include "core/features/reprojection.h"
#include "core/scene/capture.h"

namespace pepeseg {

// IoU from which masks of two views are of the same surface.
inline constexpr float kSameMask = 0.5f;

// How far a mask agrees with the masks of the near views.
struct MaskAgreement {
  int num_seen = 0;  // near views that see at least half of the mask
  int num_same = 0;  // of these, those with a mask of the same surface
  // Mean of the best IoU with a mask of each view that sees it, over what both views see, weighted
  // by the area seen. [0, 1]; 0 where no view sees it.
  float iou = 0;
};

// By view of the capture and mask; views that take no part in the reprojection have none. Masks
// are compared on the grid of the reprojection, so the cost does not grow with the photographs.
using MaskAgreements = std::vector<std::vector<MaskAgreement>>;
MaskAgreements MeasureMaskAgreement(const Capture& capture, const Reprojection& reprojection);

// Whether a mask stands alone: at least three near views see it, and its mean IoU is under
// `min_agreement`.
bool StandsAlone(const MaskAgreement& agreement, double min_agreement);

// Mean IoU of the masks that a near view sees, each weighted by the square root of its area, so
// that neither the largest nor the many small ones decide. [0, 1]; none where no mask is seen from
// elsewhere, as with one view.
std::optional<double> MaskQuality(const Capture& capture, const MaskAgreements& agreements);

}  // namespace pepeseg
