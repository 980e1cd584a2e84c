#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"

namespace pepeseg {

// What a proposal is by its place on the ladder.
enum class ProposalKind {
  kUnnamed,  // it is the only one
  kPart,     // lies in the object
  kObject,
  kGroup,  // holds the object
};

// One thing that a prompt may mean.
struct ScaleProposal {
  SegmentResult result;  // in the prompt's view, with the scale and threshold that show it
  double stability = 0;  // in [0, 1]: how little the mask changes beside them
  double support = 0;    // in (0, 1]: the share of all scales and thresholds that show this mask
  ProposalKind kind = ProposalKind::kUnnamed;
};

// Smallest first: each mask has at least 1.5 times the area of the one before and holds at least
// 95 % of its pixels; scales do not fall.
struct ScaleProposals {
  std::vector<ScaleProposal> ladder;
  int best = 0;  // index of the one with the most support: what ResolvePrompt chooses
};

inline constexpr int kDefaultProposals = 5;

// The granularities at which there is something stable under a prompt, at most `max_count`; none
// where no mask of 16 pixels appears at any scale. No view is rendered that has been.
// INVALID_ARGUMENT as Segmenter::PointFeatures; max_count under 1.
absl::StatusOr<ScaleProposals> ProposeScales(const Segmenter& segmenter, const ModelView& view,
                                             std::span<const PointPrompt> points,
                                             int max_count = kDefaultProposals);

// Names `count` proposals of which `best` has the most support: of two, the best is the object if
// it is the larger one, else the object with a group around it; of more, the object is the best one
// unless that is the smallest or the largest, and then its neighbour.
std::vector<ProposalKind> KindsOfLadder(int count, int best);

}  // namespace pepeseg
