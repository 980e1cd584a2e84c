#pragma once

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

inline constexpr int kDefaultVotingViews = 16;

struct SelectTask {
  Prompt prompt;
  Query query;  // what ResolvePrompt made of it
  // That vote, >= 1: the prompt's, and the VotingViews around what its mask shows.
  int num_views = kDefaultVotingViews;
  bool keep_disconnected = false;
};

// The Gaussians that a query means: those of which the views see more inside the masks of the query
// than outside, see GaussianVotes. Of the parts that hang together (ConnectedParts) those are kept
// that the prompted pixels show; the largest one, when they show none. With keep_disconnected so
// are the others, but never floaters: parts of under 2 % of the Gaussians of the largest part
// shown. A Gaussian that no view sees, as inside of things, goes with most of the 8 nearest seen
// ones, where it lies within the box around the members.
//
// The prompt's mask being empty, the set is empty. The same for any number of threads.
// `before_view` is called before each view: an error returned (CANCELLED, say) ends it with that
// error. Errors as Segmenter's, and INVALID_ARGUMENT for num_views < 1.
absl::StatusOr<GaussianSet> SelectGaussians(const Segmenter& segmenter, const SelectTask& task,
                                            absl::FunctionRef<absl::Status()> before_view);

}  // namespace pepeseg
