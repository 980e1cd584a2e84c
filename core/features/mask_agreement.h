#pragma once

#include <optional>
#include <vector>

#include "core/features/near_views.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Minimum IoU of two masks of different views that are taken to be of the same surface.
inline constexpr float kSameMask = 0.5f;

// Minimum IoU of two masks of different views that are taken to have the same scale.
inline constexpr float kSameScale = 0.7f;

// A mask of a view.
struct MaskOfView {
  int view = 0;  // index in the capture
  int mask = 0;
};

// Agreement of a mask with the masks of the near views (METHOD.md section 2, "Masks that
// disagree"). A view sees a mask if it sees at least half of its grid cells, and at least 6.
struct MaskAgreement {
  int num_seen = 0;  // near views that see the mask
  int num_same = 0;  // those of them that have a mask of the same surface, see kSameMask
  // Mean over the views that see the mask of its best IoU with one of their masks, weighted by the
  // area seen. An IoU is taken over the cells that both views see. [0, 1]; 0 if no view sees the
  // mask.
  float iou = 0;
  // The mask of each of these views that has the best IoU there, if it is at least kSameScale.
  std::vector<MaskOfView> same_scale;
};

// Agreements by view of the capture and mask; none for views that take no part in the reprojection.
using MaskAgreements = std::vector<std::vector<MaskAgreement>>;
// Compares the masks of all views, on the grid of the reprojection, so that the cost does not grow
// with the size of the photographs. Uses all cores of the machine.
MaskAgreements MeasureMaskAgreement(const Capture& capture, const Reprojection& reprojection);

// Replaces the scale of each mask by the median of it and of the scales of its same_scale, the
// larger of two in the middle (METHOD.md section 2). The image cuts a thing off in some views, and
// depth is wrong in some, but a thing has one size. Masks without a scale keep none. mask_scales:
// by view of the capture and mask, scene units.
void ShareScales(const MaskAgreements& agreements, std::vector<std::vector<float>>& mask_scales);

// Returns whether a mask stands alone: at least three near views see it, and its mean IoU is under
// `min_agreement`.
bool StandsAlone(const MaskAgreement& agreement, double min_agreement);

// Returns the mean IoU of the masks that at least one near view sees, each weighted by the square
// root of its area, so that neither the largest masks nor the many small ones decide. [0, 1]; none
// if no mask is seen by another view, as with a single view.
std::optional<double> MaskQuality(const Capture& capture, const MaskAgreements& agreements);

}  // namespace pepeseg
