#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// Masks that are compared to choose a granularity.
inline constexpr int64_t kMinArea = 16;          // pixels of the small view
inline constexpr size_t kMostPlateaus = 12;      // those with most support
inline constexpr double kSupportExponent = 0.5;  // of support against answered clicks

// Returns the query that a prompt stands for. Chooses scale and threshold where `granularity` has
// none (METHOD.md section 4): for points and a mean of points as ClickFollower does, for scribbles
// by the mask that answers most of their pixels and has support, for a box and a mask by the best
// fit in the prompt's view. Scribbles stand for the most usual feature under the positive strokes
// and up to four under the negative ones. Pixels of scribbles and points of a mean that have no
// feature are left out. Returns INVALID_ARGUMENT if the prompt or the granularity is out of the
// limits of Prompt and Granularity, and NothingThereError if no feature is rendered under the
// prompt.
absl::StatusOr<Query> ResolvePrompt(const Segmenter& segmenter, const Prompt& prompt,
                                    const Granularity& granularity);

// Maximum number of pixels, of each sign, that stand for scribbles.
inline constexpr size_t kScribblePoints = 64;

// Returns at most `max_count` pixels of a mask, y * width + x, evenly spread over its pixels in
// reading order.
std::vector<int32_t> SampleMask(std::span<const uint8_t> mask, size_t max_count);

// Returns the features of those pixels that can be in a mask, [found, 32]: the length of the
// blended feature is at least kMinPixelNorm. If `found` is not null, it gets their indices in
// `pixels`.
absl::StatusOr<std::vector<float>> SolidFeatures(const Segmenter& segmenter, const ModelView& view,
                                                 std::span<const int32_t> pixels,
                                                 std::vector<size_t>* found = nullptr);
// Returns the pixels of points, y * width + x.
std::vector<int32_t> PixelsOf(std::span<const PointPrompt> points, int width);
// Returns the query whose only feature is the mean direction of `features` [num, 32] at its scale.
Query MeanQuery(const Segmenter& segmenter, std::span<const float> features, double scale,
                double threshold);

// Returns the mean directions of at most `count` clusters of features [n, 32], none of which is 0:
// [clusters, 32] of length 1, the largest cluster first. Clusters with less than `min_share` of the
// features are dropped.
std::vector<float> ClusterDirections(std::span<const float> features, int count, double min_share);

// Query of a mask (fit_mask.cc), of a box (fit_box.cc) and of scribbles (fit_scribbles.cc).

// Returns the query whose mask in the view has the best IoU with `mask`: the features under it as
// one to four clusters, a scale and a threshold (METHOD.md section 4, "Mask"). Returns
// INVALID_ARGUMENT if the mask is empty or does not have the view's size, and NothingThereError if
// no feature is rendered under it.
absl::StatusOr<Query> FitMask(const Segmenter& segmenter, const ModelView& view,
                              const BinaryMask& mask, const Granularity& granularity);

// Returns the query whose mask fills the box best, scored mainly by the IoU of the box and the
// mask's bounding box, times the share of the mask inside the box. The query has one feature from
// the middle of the box, or several where only their masks together fill it, a scale and a
// threshold. Returns INVALID_ARGUMENT if the box is not finite, is empty or lies outside the view,
// and NothingThereError if no feature is rendered there.
absl::StatusOr<Query> FitBox(const Segmenter& segmenter, const ModelView& view,
                             const BoxPrompt& box, const Granularity& granularity);

// Returns the query of the feature that is nearest to the mean direction of those under the
// positive strokes, and of up to four mean directions under the negative ones. Its scale and
// threshold are those of the mask that has the largest product of strokes answered and square root
// of support.
absl::StatusOr<Query> FitScribbles(const Segmenter& segmenter, const ModelView& view,
                                   const Scribbles& scribbles, const Granularity& granularity);

}  // namespace pepeseg
