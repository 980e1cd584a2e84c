#include "core/query/propose.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/click_follower.h"

namespace pepeseg {
namespace {

// Returns whether `large` may come after `small`, by their masks in the view itself. The candidates
// were found in a smaller view, in which masks may nest that do not nest here.
bool Holds(const SegmentResult& large, const SegmentResult& small) {
  int64_t common = 0;
  for (size_t p = 0; p < small.mask.pixels.size(); ++p) {
    common += small.mask.pixels[p] != 0 && large.mask.pixels[p] != 0 ? 1 : 0;
  }
  const auto area = static_cast<double>(small.area);
  return static_cast<double>(large.area) >= Candidates::kMinGrowth * area &&
         static_cast<double>(common) >= Candidates::kMinHeld * area;
}

// Removes candidates that do not nest with their neighbour on the side of the best one.
void KeepNested(Proposals& proposals) {
  auto& [candidates, masks] = proposals;
  const auto erase = [&](int i) {
    proposals.candidates.list.erase(proposals.candidates.list.begin() + i);
    proposals.masks.erase(proposals.masks.begin() + i);
  };
  for (int i = candidates.best - 1; i >= 0; --i) {
    if (Holds(masks[i + 1], masks[i])) continue;
    erase(i);
    --candidates.best;
  }
  for (int i = candidates.best + 1; i < static_cast<int>(masks.size());) {
    if (Holds(masks[i], masks[i - 1])) {
      ++i;
    } else {
      erase(i);
    }
  }
}

}  // namespace

absl::StatusOr<Proposals> Propose(const Segmenter& segmenter, const ProposeRequest& request) {
  if (request.max_count < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(request.max_count, " proposals are asked for, must be at least 1"));
  }
  const ModelView& view = request.prompt.view;
  const auto* points = std::get_if<PointsPrompt>(&request.prompt.what);
  // A box or a mask already says how large the object is.
  if (points == nullptr) return FaultError({"", "", "only points have proposals"});
  ClickFollower follower(segmenter, nullptr, view, {});
  RETURN_IF_ERROR(
      follower.Follow(*points, request.prompt.previous, [] { return absl::OkStatus(); }));
  const Query& clicked = follower.features();
  Proposals proposals;
  proposals.candidates = follower.Found(request.max_count);
  std::vector<Query> queries;
  for (const Candidate& at : proposals.candidates.list) {
    queries.push_back({clicked.features, clicked.positive, at.scale, at.threshold});
  }
  ASSIGN_OR_RETURN(proposals.masks, segmenter.Segment(queries, view, request.options));
  KeepNested(proposals);
  const Frame frame(view, request.frame);
  for (SegmentResult& mask : proposals.masks) mask = frame.FromView(std::move(mask));
  return proposals;
}

ProposalKind KindOf(int i, int count, int best) {
  if (count < 2) return ProposalKind::kUnnamed;
  const int object = count == 2 ? best : std::clamp(best, 1, count - 2);
  if (i == object) return ProposalKind::kObject;
  return i < object ? ProposalKind::kPart : ProposalKind::kGroup;
}

}  // namespace pepeseg
