#pragma once

#include "core/query/prompt.h"
#include "core/query/view_features.h"

namespace pepeseg {

// Sets the mask of a result, and the area, box and score that follow from it. The result must have
// the similarity of each pixel.
void SetMask(BinaryMask mask, SegmentResult& result);

// How far the answer to a box may reach beyond it, pixels of the view. Boxes are drawn by hand.
inline constexpr double kBoxSlack = 5;

// Cuts the mask of the answer to a box, in the view of the box, to the box and kBoxSlack around it.
// Returns the IoU of the box, as far as it lies in the view, and the mask's bounding box before the
// cut: low where the model shows nothing that fills the box. The result must have the similarity of
// each pixel.
double CutToBox(const BoxPrompt& box, SegmentResult& result);

}  // namespace pepeseg
