#include "core/select/select_gaussians.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/select/connected_parts.h"
#include "core/select/gaussian_sets.h"
#include "core/select/gaussian_votes.h"
#include "core/select/mean_tree.h"
#include "core/select/prompted_pixels.h"
#include "core/select/voting_views.h"

namespace pepeseg {
namespace {

constexpr float kShownWeight = 0.1f;    // of a pixel: what has less is not what it shows
constexpr double kFloaterShare = 0.02;  // of the largest part shown
constexpr size_t kMaxPromptedPixels = 16'384;
constexpr int kSeenNeighbors = 8;

// Which Gaussians the prompt points at: [num_gaussians], the most that each adds to one of the
// prompted pixels. Pixels outside the prompt's mask do not count, unless all are.
absl::StatusOr<std::vector<float>> ShownWeights(const Segmenter& segmenter, const Prompt& prompt,
                                                const BinaryMask& mask) {
  std::vector<int32_t> pixels = PromptedPixels(prompt, kMaxPromptedPixels);
  std::vector<int32_t> in_mask;
  std::copy_if(pixels.begin(), pixels.end(), std::back_inserter(in_mask),
               [&](int32_t pixel) { return mask.pixels[pixel] != 0; });
  if (!in_mask.empty()) pixels = std::move(in_mask);
  ASSIGN_OR_RETURN(const PixelRows rows, segmenter.Rows(prompt.view, pixels));
  std::vector<float> shown(static_cast<size_t>(segmenter.model().gaussians.count));
  for (size_t e = 0; e < rows.gaussian.size(); ++e) {
    float& most = shown[rows.gaussian[e]];
    most = std::max(most, rows.weight[e]);
  }
  return shown;
}

struct Part {
  int64_t size = 0;
  bool shown = false;
};

void MarkLargest(std::vector<Part>& parts) {
  std::max_element(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return a.size < b.size;
  })->shown = true;
}

// The members of the parts that stay.
GaussianSet KeepParts(const Gaussians& gaussians, const std::vector<int32_t>& members,
                      const std::vector<float>& shown, bool keep_disconnected) {
  GaussianSet kept = {std::vector<uint8_t>(static_cast<size_t>(gaussians.count))};
  if (members.empty()) return kept;
  const std::vector<int32_t> part_of = ConnectedParts(gaussians, members);
  std::vector<Part> parts(1 + *std::max_element(part_of.begin(), part_of.end()));
  for (size_t i = 0; i < members.size(); ++i) {
    Part& part = parts[part_of[i]];
    ++part.size;
    part.shown = part.shown || shown[members[i]] >= kShownWeight;
  }
  if (std::none_of(parts.begin(), parts.end(), [](const Part& part) { return part.shown; })) {
    MarkLargest(parts);
  }
  int64_t largest = 0;
  for (const Part& part : parts) largest = std::max(largest, part.shown ? part.size : 0);
  for (size_t i = 0; i < members.size(); ++i) {
    const Part& part = parts[part_of[i]];
    const bool floats =
        static_cast<double>(part.size) < kFloaterShare * static_cast<double>(largest);
    kept.member[members[i]] = (part.shown || keep_disconnected) && !floats ? 1 : 0;
  }
  return kept;
}

// Decides those that no view saw.
void AddUnseen(const Gaussians& gaussians, const GaussianVotes& votes, GaussianSet& set) {
  const SetBounds bounds = BoundsOf(gaussians, set);
  if (bounds.empty()) return;
  std::vector<int32_t> seen, unseen;
  for (int32_t i = 0; i < gaussians.count; ++i) {
    const Eigen::Vector3d mean(gaussians.Plane(kMeanPlane)[i], gaussians.Plane(kMeanPlane + 1)[i],
                               gaussians.Plane(kMeanPlane + 2)[i]);
    if ((mean.array() < bounds.min.array()).any() || (mean.array() > bounds.max.array()).any()) {
      continue;
    }
    (votes.Seen(i) ? seen : unseen).push_back(i);
  }
  const MeanTree tree(gaussians, seen);
  for (const int32_t i : unseen) {
    const std::vector<int32_t> nearest = tree.Nearest(i, kSeenNeighbors);
    const auto num_members = std::count_if(nearest.begin(), nearest.end(),
                                           [&](int32_t at) { return set.member[seen[at]] != 0; });
    set.member[i] = 2 * num_members > static_cast<int64_t>(nearest.size()) ? 1 : 0;
  }
}

absl::StatusOr<SegmentResult> AddVotes(const Segmenter& segmenter, const Query& query,
                                       const ModelView& view, GaussianVotes& votes) {
  ASSIGN_OR_RETURN(std::vector<SegmentResult> results, segmenter.Segment(query, {&view, 1}));
  RETURN_IF_ERROR(votes.Add(segmenter, view, results.front()));
  return std::move(results.front());
}

}  // namespace

absl::StatusOr<GaussianSet> SelectGaussians(const Segmenter& segmenter, const SelectTask& task,
                                            absl::FunctionRef<absl::Status()> before_view) {
  if (task.num_views < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("num_views is ", task.num_views, ", must be at least 1"));
  }
  const Gaussians& gaussians = segmenter.model().gaussians;
  GaussianVotes votes(gaussians.count);
  RETURN_IF_ERROR(before_view());
  ASSIGN_OR_RETURN(const SegmentResult prompted,
                   AddVotes(segmenter, task.query, task.prompt.view, votes));
  if (prompted.box[2] == 0) {
    return GaussianSet{std::vector<uint8_t>(static_cast<size_t>(gaussians.count))};
  }
  const std::vector<ModelView> others =
      VotingViews(segmenter.model().views, task.prompt.view.name, votes.CenterInside(gaussians),
                  static_cast<size_t>(task.num_views - 1));
  for (const ModelView& view : others) {
    RETURN_IF_ERROR(before_view());
    RETURN_IF_ERROR(AddVotes(segmenter, task.query, view, votes).status());
  }
  std::vector<int32_t> members;
  for (int32_t i = 0; i < gaussians.count; ++i) {
    if (votes.Inside(i)) members.push_back(i);
  }
  ASSIGN_OR_RETURN(const std::vector<float> shown,
                   ShownWeights(segmenter, task.prompt, prompted.mask));
  GaussianSet set = KeepParts(gaussians, members, shown, task.keep_disconnected);
  AddUnseen(gaussians, votes, set);
  return set;
}

}  // namespace pepeseg
