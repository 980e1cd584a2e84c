#include "core/query/select_gaussians.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <nanoflann.hpp>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/disjoint_sets.h"
#include "core/base/status_macros.h"
#include "core/query/gaussian_votes.h"
#include "core/scene/gaussians.h"

namespace pepeseg {
namespace {

// Pixels around a point that a prompt points at: the clicked one may show a gap between Gaussians.
constexpr double kPointRadius = 2;
constexpr float kShownWeight = 0.1f;  // minimum blending weight in a pixel that shows a Gaussian
// A floater has less than this share of the Gaussians of the largest part shown.
constexpr double kFloaterShare = 0.02;
constexpr size_t kMaxPromptedPixels = 16'384;
constexpr int kSeenNeighbors = 8;  // that decide about a Gaussian that no view sees
constexpr int kNumNeighbors = 16;  // of ConnectedParts, without the Gaussian itself
constexpr float kReach = 3;        // of a Gaussian, standard deviations

// Finds the nearest of some Gaussians by their means, with a k-d tree. Thread safe.
class MeanTree {
 public:
  // selected: indices into `gaussians`. Both must outlive the tree.
  MeanTree(const Gaussians& gaussians, std::span<const int32_t> selected)
      : cloud_{gaussians, selected},
        tree_(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  // Returns the `num` selected Gaussians nearest to the mean of a Gaussian, or all if there are
  // fewer: positions in `selected`, nearest first. If the Gaussian itself is selected, it is one of
  // them (unless more than `num` Gaussians have the same mean).
  std::vector<int32_t> Nearest(int32_t gaussian, int num) const {
    std::vector<int32_t> found(static_cast<size_t>(num));
    std::vector<float> squared(found.size());
    const float mean[3] = {cloud_.At(gaussian, 0), cloud_.At(gaussian, 1), cloud_.At(gaussian, 2)};
    found.resize(tree_.knnSearch(mean, found.size(), found.data(), squared.data()));
    return found;
  }

 private:
  // The selected means as a data set of nanoflann.
  struct Cloud {
    const Gaussians& gaussians;
    std::span<const int32_t> selected;

    float At(int32_t gaussian, size_t axis) const {
      return gaussians.Plane(kMeanPlane + static_cast<int>(axis))[gaussian];
    }
    size_t kdtree_get_point_count() const { return selected.size(); }
    float kdtree_get_pt(size_t i, size_t axis) const { return At(selected[i], axis); }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>,
                                                   Cloud, 3, int32_t>;

  Cloud cloud_;
  Tree tree_;
};

// Returns three consecutive parameters of a Gaussian.
Eigen::Vector3f ThreePlanes(const Gaussians& gaussians, int first, int32_t gaussian) {
  return {gaussians.Plane(first)[gaussian], gaussians.Plane(first + 1)[gaussian],
          gaussians.Plane(first + 2)[gaussian]};
}

// Returns the standard deviation of a Gaussian along a unit vector: sqrt(d^T Sigma d).
float DeviationAlong(const Gaussians& gaussians, int32_t gaussian,
                     const Eigen::Vector3f& direction) {
  const Eigen::Vector3f imaginary = ThreePlanes(gaussians, kRotationPlane + 1, gaussian);
  const Eigen::Quaternionf rotation(gaussians.Plane(kRotationPlane)[gaussian], imaginary.x(),
                                    imaginary.y(), imaginary.z());
  const Eigen::Vector3f scale = ThreePlanes(gaussians, kLogScalePlane, gaussian).array().exp();
  // Sigma = R S S^T R^T, so that sqrt(d^T Sigma d) = |S R^T d|.
  return scale.cwiseProduct(rotation.normalized().conjugate() * direction).norm();
}

// Returns whether two Gaussians touch, see ConnectedParts.
bool Touch(const Gaussians& gaussians, int32_t a, int32_t b) {
  const Eigen::Vector3f between =
      ThreePlanes(gaussians, kMeanPlane, b) - ThreePlanes(gaussians, kMeanPlane, a);
  const float distance = between.norm();
  if (distance == 0) return true;
  const Eigen::Vector3f direction = between / distance;
  return distance <= kReach * (DeviationAlong(gaussians, a, direction) +
                               DeviationAlong(gaussians, b, direction));
}

// Returns whether a prompt points at a pixel with this centre. pixel: y * width + x.
bool PointsAt(const Shape& shape, double x, double y, int32_t pixel) {
  if (const BinaryMask* mask = MaskOf(shape)) return mask->pixels[pixel] != 0;
  if (const PointsPrompt* points = PointsOf(shape)) {
    return std::any_of(points->begin(), points->end(), [&](const PointPrompt& point) {
      return point.positive && std::hypot(point.x - x, point.y - y) <= kPointRadius;
    });
  }
  const auto& box = std::get<BoxPrompt>(shape);
  return x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
}

// Returns how much the prompted pixels show of each Gaussian, [num_gaussians]: its largest blending
// weight in one of them. Pixels outside the mask of the prompt do not count, unless all are
// outside.
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

// A connected part of the members.
struct Part {
  int64_t size = 0;    // Gaussians
  bool shown = false;  // in the prompted pixels
};

// Marks the largest part as shown.
void MarkLargest(std::vector<Part>& parts) {
  std::max_element(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return a.size < b.size;
  })->shown = true;
}

// Returns the members of the parts that are kept, see SelectGaussians. shown: see ShownWeights.
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
  // The prompted pixels may show only Gaussians that the other views voted out.
  if (std::none_of(parts.begin(), parts.end(), [](const Part& part) { return part.shown; })) {
    MarkLargest(parts);
  }
  int64_t largest = 0;
  for (const Part& part : parts) largest = std::max(largest, part.shown ? part.size : 0);
  for (size_t i = 0; i < members.size(); ++i) {
    const Part& part = parts[part_of[i]];
    const bool is_floater =
        static_cast<double>(part.size) < kFloaterShare * static_cast<double>(largest);
    kept.member[members[i]] = (part.shown || keep_disconnected) && !is_floater ? 1 : 0;
  }
  return kept;
}

// Adds the Gaussians that no view sees if most of their nearest seen neighbours are in the set.
void AddUnseen(const Gaussians& gaussians, const GaussianVotes& votes, GaussianSet& set) {
  const SetBounds bounds = BoundsOf(gaussians, set);
  if (bounds.empty()) return;
  std::vector<int32_t> seen, unseen;
  for (int32_t i = 0; i < gaussians.count; ++i) {
    const Eigen::Vector3d mean(gaussians.Plane(kMeanPlane)[i], gaussians.Plane(kMeanPlane + 1)[i],
                               gaussians.Plane(kMeanPlane + 2)[i]);
    // Only Gaussians within the bounds of the set can be inside what it shows.
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

// Segments a view, adds its votes, and returns its mask.
absl::StatusOr<SegmentResult> AddVotes(const Segmenter& segmenter, ResultInView mask_in,
                                       const ModelView& view, GaussianVotes& votes) {
  ASSIGN_OR_RETURN(SegmentResult result, mask_in(view));
  RETURN_IF_ERROR(votes.Add(segmenter, view, result));
  return result;
}

}  // namespace

std::vector<int32_t> PromptedPixels(const Prompt& prompt, size_t max_count) {
  const int width = prompt.view.camera.width, height = prompt.view.camera.height;
  std::vector<int32_t> pixels;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int32_t pixel = y * width + x;
      if (PointsAt(prompt.what, x + 0.5, y + 0.5, pixel)) pixels.push_back(pixel);
    }
  }
  if (pixels.size() <= max_count) return pixels;
  std::vector<int32_t> thinned;
  thinned.reserve(max_count);
  for (size_t i = 0; i < max_count; ++i) {
    // The middle of each of max_count equal parts: spread evenly, without a draw.
    thinned.push_back(pixels[(2 * i + 1) * pixels.size() / (2 * max_count)]);
  }
  return thinned;
}

std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> selected) {
  std::vector<int32_t> part(selected.size());
  if (selected.empty()) return part;
  const MeanTree tree(gaussians, selected);
  DisjointSets parts(selected.size());  // of the selected Gaussians, by their position
  for (uint32_t i = 0; i < selected.size(); ++i) {
    // One more than the neighbours: the Gaussian finds itself.
    for (const int32_t near : tree.Nearest(selected[i], kNumNeighbors + 1)) {
      if (Touch(gaussians, selected[i], selected[near])) {
        parts.Join(i, static_cast<uint32_t>(near));
      }
    }
  }
  int32_t num_parts = 0;
  for (uint32_t i = 0; i < selected.size(); ++i) {
    // The representative is the lowest position of its part, so it has a number before its members
    // ask for it.
    const uint32_t lead = parts.Find(i);
    part[i] = lead == i ? num_parts++ : part[lead];
  }
  return part;
}

absl::StatusOr<GaussianSet> SelectGaussians(const Segmenter& segmenter,
                                            const SelectRequest& request, ResultInView mask_in,
                                            absl::FunctionRef<absl::Status()> before_view) {
  if (request.num_views < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("num_views is ", request.num_views, ", must be at least 1"));
  }
  const Gaussians& gaussians = segmenter.model().gaussians;
  GaussianVotes votes(gaussians.count);
  RETURN_IF_ERROR(before_view());
  ASSIGN_OR_RETURN(const SegmentResult prompted,
                   AddVotes(segmenter, mask_in, request.prompt.view, votes));
  // An empty mask in the prompted view: there is no centre by which to choose other views.
  if (prompted.box[2] == 0) {
    return GaussianSet{std::vector<uint8_t>(static_cast<size_t>(gaussians.count))};
  }
  const std::vector<ModelView> others =
      VotingViews(segmenter.model().views, request.prompt.view.name, votes.CenterInside(gaussians),
                  static_cast<size_t>(request.num_views - 1));
  for (const ModelView& view : others) {
    RETURN_IF_ERROR(before_view());
    RETURN_IF_ERROR(AddVotes(segmenter, mask_in, view, votes).status());
  }
  std::vector<int32_t> members;
  for (int32_t i = 0; i < gaussians.count; ++i) {
    if (votes.Inside(i)) members.push_back(i);
  }
  ASSIGN_OR_RETURN(const std::vector<float> shown,
                   ShownWeights(segmenter, request.prompt, prompted.mask));
  GaussianSet set = KeepParts(gaussians, members, shown, request.keep_disconnected);
  AddUnseen(gaussians, votes, set);
  return set;
}

}  // namespace pepeseg
