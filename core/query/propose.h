#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/query/frame.h"
#include "core/query/mask_grid.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

inline constexpr int kDefaultProposals = 5;

struct ProposeRequest {
  Prompt prompt;                             // points
  int max_count = kDefaultProposals;         // at least 1
  FrameKind frame = FrameKind::kPhotograph;  // of the masks
  SegmentOptions options = {};               // of the masks
};

// Masks that the points of a prompt may stand for.
struct Proposals {
  Candidates candidates;
  std::vector<SegmentResult> masks;  // [candidates] in the prompt's view
};

// Returns the granularities at which the points show something stable, or none if no mask of 16
// pixels appears at any scale. The best one is the mask of the model that the answer to the clicks
// came from (ClickFollower). Renders no view whose feature map is cached. Returns
// INVALID_ARGUMENT for the reasons of Segmenter::PointFeatures, for prompts of other kinds, and if
// max_count < 1.
absl::StatusOr<Proposals> Propose(const Segmenter& segmenter, const ProposeRequest& request);

// The role of a candidate by its position among the candidates.
enum class ProposalKind {
  kUnnamed,  // the only one
  kPart,     // lies inside the object
  kObject,
  kGroup,  // contains the object
};
// Returns the role of the candidate at index i of `count`, of which the one at index `best` is
// chosen. A single one is unnamed. Of two, the best one is the object, and the other its part or
// its group. Of more, the best one is the object unless it is the smallest or the largest; then its
// neighbour is.
ProposalKind KindOf(int i, int count, int best);

}  // namespace pepeseg
