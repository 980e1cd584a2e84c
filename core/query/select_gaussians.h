#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/image_segmenter.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

inline constexpr int kDefaultVotingViews = 16;

struct SelectRequest {
  Prompt prompt;
  Granularity granularity = {};
  // Maximum number of views that vote, at least 1: the view of the prompt, and VotingViews around
  // what its mask shows.
  int num_views = kDefaultVotingViews;
  bool keep_disconnected = false;  // keep parts that the prompted pixels do not show
  // Answers with the model (PromptedThing), for a prompt of points or a box without scale and
  // threshold. Null: only the model answers.
  ImageSegmenter* images = nullptr;
};
// Returns the mask of the prompt in a view.
using ResultInView = absl::FunctionRef<absl::StatusOr<SegmentResult>(const ModelView&)>;

// Returns the pixels of its view that a prompt points at, y * width + x, ascending: those within 2
// pixels of a positive point, those whose centre is in the box, or those of the mask or the
// positive strokes. If there are more than `max_count` (> 0), that many of them, spread evenly.
std::vector<int32_t> PromptedPixels(const Prompt& prompt, size_t max_count);

// Returns the connected part of each of the `selected` Gaussians (indices into `gaussians`, without
// repeats): 0, 1, ... in the order in which the parts appear in `selected`.
//
// A Gaussian is connected to those of its 16 nearest selected neighbours that it touches. Two
// Gaussians touch if their ellipsoids of 3 standard deviations, to which splats are drawn, together
// reach from one mean to the other along the line between them.
std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> selected);

// Selects the Gaussians of what a prompt means in 3D (METHOD.md section 4, "Selection in 3D").
// - Views vote: a Gaussian is a member if they see more of it inside their masks than outside, see
//   GaussianVotes.
// - Of the ConnectedParts of the members, those are kept that the prompted pixels show, or the
//   largest one if they show none. With keep_disconnected the others are kept as well. Floaters
//   are never kept: parts with under 2 % of the Gaussians of the largest part shown.
// - A Gaussian that no view sees, such as one inside an object, is added if it lies in the bounding
//   box of the kept members, and most of the 8 nearest seen Gaussians in it are among them.
//
// The set is empty if the mask in the prompt's view is empty. It does not depend on the number of
// threads. Calls `before_view` before each view and `mask_in` for each; an error that it returns
// (such as CANCELLED) ends the selection with that error. INVALID_ARGUMENT: num_views < 1. Other
// errors are those of `mask_in` and of Segmenter.
absl::StatusOr<GaussianSet> SelectGaussians(const Segmenter& segmenter,
                                            const SelectRequest& request, ResultInView mask_in,
                                            absl::FunctionRef<absl::Status()> before_view);

}  // namespace pepeseg
