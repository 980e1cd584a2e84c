#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// The role of a proposal by its position on the ladder.
enum class ProposalKind {
  kUnnamed,  // the only proposal
  kPart,     // lies inside the object
  kObject,
  kGroup,  // contains the object
};

// One of the things that a prompt may mean.
struct ScaleProposal {
  SegmentResult result;  // the mask in the prompt's view, with its scale and threshold
  double stability = 0;  // [0, 1], see MaskGrid::Stability
  double support = 0;    // (0, 1], share of all scales and thresholds that show this mask
  ProposalKind kind = ProposalKind::kUnnamed;
};

// Proposals, smallest first: each mask has at least 1.5 times the area of the one before and
// contains at least 95 % of its pixels; scales do not decrease.
struct ScaleProposals {
  std::vector<ScaleProposal> ladder;
  int best = 0;  // index of the proposal that ResolvePrompt chooses
};

inline constexpr int kDefaultProposals = 5;

struct ProposeOptions {
  int max_count = kDefaultProposals;  // at least 1
  SegmentOptions segment = {};        // of the masks
};

// Returns the granularities at which the points show something stable, or none if no mask of 16
// pixels appears at any scale. Renders no view whose feature map is cached. Returns
// INVALID_ARGUMENT for the reasons of Segmenter::PointFeatures, and if max_count < 1.
absl::StatusOr<ScaleProposals> ProposeScales(const Segmenter& segmenter, const ModelView& view,
                                             std::span<const PointPrompt> points,
                                             const ProposeOptions& options = {});

// Returns the roles of `count` proposals of which the one at index `best` is chosen. A single
// proposal is unnamed. Of two, the best one is the object, and the other its part or its group. Of
// more, the best one is the object unless it is the smallest or the largest; then its neighbour is.
std::vector<ProposalKind> KindsOfLadder(int count, int best);

}  // namespace pepeseg
