#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/mask_set.h"

// Masks as logits of the network's grid, which is what a prompt takes.

namespace pepeseg {

inline constexpr float kMostLogit = 10;  // of a mask that is a prompt

// Returns the distance of each pixel's centre from the nearest pixel on the other side of the
// mask's border, pixels: positive inside. mask: CV_8U, 0 and 1.
cv::Mat SignedDistance(const cv::Mat& mask);
// Returns the logits for a mask with this signed distance, [extent, extent]: they grow with the
// distance from the border up to kMostLogit. Cells to the right of the image and below it are
// outside. grid: that of the image.
std::vector<float> LogitsOfDistance(const cv::Mat& distance, const PromptAnswers& grid, int extent);
// Returns the logits for a mask [height, width], [extent, extent].
std::vector<float> LogitsOfMask(const BinaryMask& mask, int width, int height, int extent);

}  // namespace pepeseg
