#include "core/edit/fill_hole.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/edit/hole_picture.h"
#include "core/edit/nearest_points.h"
#include "core/edit/support_planes.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

// A Gaussian is covered by the thing if no pixel shows more than this share of what one shows of it
// without the thing, and if it is this near to the thing, in radii of the thing. What is under a
// thing is far from its Gaussians, which are on its sides.
constexpr float kMinSeenShare = 0.25f, kMinSeenShareAround = 0.1f;
constexpr double kCoveredReach = 0.25, kCoveredReachAround = 1;
constexpr int kCoveredRounds = 2;  // what is covered by what is covered is found in the next one
constexpr size_t kMaxThingSamples = 8192;
constexpr int64_t kMinOpenPixels = 24;  // of a view, that are worth a patch
constexpr int kMaxViewFills = 6;
// A patch may be this many pixels outside of what the thing covers in a view, or in front of what
// is seen there by this share of the depth.
constexpr int kCoverMargin = 2;
constexpr float kDepthMargin = 0.02f;

// Returns the Gaussians of `rest` around a thing, or all of it if there are none.
std::vector<int64_t> RestAround(const Gaussians& gaussians, const GaussianSet& rest,
                                const ThingSpace& space) {
  std::vector<int64_t> rows = RowsOf(rest), near;
  std::ranges::copy_if(rows, std::back_inserter(near), [&](int64_t row) {
    return (MeanOf(gaussians, row) - space.center).norm() <= 3 * space.radius;
  });
  return near.empty() ? rows : near;
}

}  // namespace

absl::StatusOr<std::unique_ptr<HoleFill>> HoleFill::Create(const Segmenter& segmenter,
                                                           GaussianSet thing) {
  const int64_t num = thing.count(), all = segmenter.model().gaussians.count;
  if (num == 0 || num == all) {
    return absl::InvalidArgumentError(
        absl::StrCat(num, " of ", all, " Gaussians to remove; some must go, and some must stay"));
  }
  return absl::WrapUnique(new HoleFill(segmenter, std::move(thing)));
}

HoleFill::HoleFill(const Segmenter& segmenter, GaussianSet thing)
    : segmenter_(segmenter),
      thing_(RowsOf(thing)),
      space_(SpaceOf(segmenter.model().gaussians, thing_)),
      views_(ThingViews(segmenter.model(), thing_)),
      seen_(static_cast<size_t>(segmenter.model().gaussians.count)),
      shown_(seen_.size()),
      removed_(std::move(thing)),
      rest_(removed_) {
  for (uint8_t& member : rest_.member) member = member != 0 ? 0 : 1;
}

absl::Status HoleFill::Next() {
  const auto next_part = [this](Part part) {
    if (++next_ < views_.size()) return;
    part_ = part;
    next_ = 0;
  };
  switch (part_) {
    case Part::kSeen:
      if (next_ < views_.size()) RETURN_IF_ERROR(AddShown(nullptr, seen_));
      next_part(Part::kShown);
      return absl::OkStatus();
    case Part::kShown:
      if (next_ < views_.size()) RETURN_IF_ERROR(AddShown(&rest_, shown_));
      next_part(Part::kLook);
      if (part_ == Part::kShown) return absl::OkStatus();
      RemoveCovered();
      if (rest_.count() == 0) {
        return absl::InvalidArgumentError(
            "the thing hides all else in all views: nothing would be left");
      }
      if (++round_ < kCoveredRounds) part_ = Part::kShown;
      return absl::OkStatus();
    case Part::kLook:
      if (next_ < views_.size()) {
        ASSIGN_OR_RETURN(ThingLook look, LookWithout(segmenter_, views_[next_], rest_));
        looks_.push_back(std::move(look));
      }
      next_part(Part::kPlanes);
      return absl::OkStatus();
    case Part::kPlanes:
      RETURN_IF_ERROR(FillPlanes());
      part_ = Part::kViews;
      return absl::OkStatus();
    case Part::kViews:
      FillViews();
      AddPatches();
      part_ = Part::kDone;
      return absl::OkStatus();
    case Part::kDone:
      break;
  }
  return absl::OkStatus();
}

HoleFill::Progress HoleFill::progress() const {
  const auto done = static_cast<int64_t>(next_), all = static_cast<int64_t>(views_.size());
  switch (part_) {
    case Part::kSeen:
    case Part::kShown:
      return {"looking at the thing", done, all};
    case Part::kLook:
      return {"looking behind the thing", done, all};
    case Part::kPlanes:
    case Part::kViews:
      return {"filling the hole", part_ == Part::kViews ? 1 : 0, 2};
    case Part::kDone:
      break;
  }
  return {"done", 1, 1};
}

absl::Status HoleFill::AddShown(const GaussianSet* subset, std::vector<float>& weights) {
  ASSIGN_OR_RETURN(const PixelRows rows, RowsOfView(segmenter_, views_[next_], subset));
  for (size_t e = 0; e < rows.gaussian.size(); ++e) {
    float& most = weights[rows.gaussian[e]];
    most = std::max(most, rows.weight[e]);
  }
  return absl::OkStatus();
}

// Without a view nothing is known to be covered.
void HoleFill::RemoveCovered() {
  const Gaussians& gaussians = segmenter_.model().gaussians;
  const size_t stride = (thing_.size() + kMaxThingSamples - 1) / kMaxThingSamples;
  std::vector<Eigen::Vector3d> points;
  for (size_t i = 0; i < thing_.size(); i += stride) {
    points.push_back(MeanOf(gaussians, thing_[i]));
  }
  const NearestPoints nearest(points);
  const double around = (1 + kCoveredReachAround) * space_.radius;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    if (removed_.member[i] != 0 || seen_[i] >= kMinSeenShare * shown_[i]) continue;
    const Eigen::Vector3d mean = MeanOf(gaussians, i);
    if ((mean - space_.center).norm() > around) continue;
    const double distance = nearest.Find(mean).distance;
    const bool is_hidden = seen_[i] < kMinSeenShareAround * shown_[i];
    if (distance > (is_hidden ? kCoveredReachAround : kCoveredReach) * space_.radius) continue;
    removed_.member[i] = 1;
    rest_.member[i] = 0;
  }
  std::ranges::fill(shown_, 0.0f);
}

absl::Status HoleFill::FillPlanes() {
  for (const SupportPlane& plane :
       FindSupportPlanes(segmenter_.model().gaussians, rest_, thing_, space_)) {
    ASSIGN_OR_RETURN(const PlaneFill fill, FillPlane(segmenter_, plane, rest_, thing_));
    AddHidden(fill.patches);
    lit_.insert(lit_.end(), fill.lit.begin(), fill.lit.end());
  }
  return absl::OkStatus();
}

// The view that is open most is filled first, since what it gets covers pixels of the others.
void HoleFill::FillViews() {
  for (int round = 0; round < kMaxViewFills; ++round) {
    size_t most_view = 0;
    int64_t most = 0;
    std::vector<uint8_t> most_open;
    for (size_t i = 0; i < views_.size(); ++i) {
      std::vector<uint8_t> open = OpenPixels(views_[i], looks_[i], patches_);
      const int64_t num = std::ranges::count(open, uint8_t{1});
      if (num > most) most = num, most_view = i, most_open = std::move(open);
    }
    if (most < kMinOpenPixels) return;
    const std::vector<Patch> patches =
        ViewPatches(views_[most_view], looks_[most_view], std::move(most_open), space_);
    const size_t before = patches_.size();
    AddHidden(patches);
    if (patches_.size() == before) return;
  }
}

// What a view shows next to the thing is known there: a patch in front of it would be wrong.
void HoleFill::AddHidden(const std::vector<Patch>& patches) {
  std::vector<uint8_t> is_seen(patches.size());
  for (size_t v = 0; v < views_.size(); ++v) {
    const Camera& camera = views_[v].camera;
    const std::vector<uint8_t> covered =
        Dilated(looks_[v].changed, camera.width, camera.height, kCoverMargin);
    for (size_t i = 0; i < patches.size(); ++i) {
      const std::optional<Eigen::Vector2d> at = PixelOf(views_[v], patches[i].mean);
      if (!at || !IsInView(views_[v], *at)) continue;
      const size_t pixel =
          static_cast<size_t>(at->y()) * camera.width + static_cast<size_t>(at->x());
      if (covered[pixel] != 0) continue;
      const float depth = looks_[v].depth[pixel];
      const double z = (views_[v].cam_from_world * patches[i].mean).z();
      if (depth == 0 || z < (1 - kDepthMargin) * depth) is_seen[i] = 1;
    }
  }
  for (size_t i = 0; i < patches.size(); ++i) {
    if (is_seen[i] == 0) patches_.push_back(patches[i]);
  }
}

void HoleFill::AddPatches() {
  const Model& model = segmenter_.model();
  const std::vector<int64_t> around = RestAround(model.gaussians, rest_, space_);
  NewGaussians added = {Gaussians::Zero(0, model.gaussians.sh_degree), {}};
  if (!around.empty() && !patches_.empty()) {
    added = GaussiansOf(patches_, model.gaussians.sh_degree,
                        NearestPoints(MeansOf(model.gaussians, around)), around);
  }
  edited_ = RemoveGaussians(model, removed_, added);
  // The places of the Gaussians that stay.
  std::vector<int64_t> place(removed_.member.size());
  int64_t num = 0;
  for (size_t i = 0; i < place.size(); ++i) place[i] = removed_.member[i] == 0 ? num++ : -1;
  for (const PlaneFill::Lit& lit : lit_) {
    if (place[lit.row] < 0) continue;  // another plane has lit it
    ScaleColor(lit.factor, place[lit.row], edited_.gaussians);
    place[lit.row] = -1;
    ++edited_.num_changed;
  }
}

int64_t BytesOfFill(const Model& model) {
  constexpr int64_t kPixels = int64_t{kThingViewSide} * kThingViewSide;
  constexpr int64_t kBytesOfLook = 8, kBytesOfRow = 1024;  // of a pixel
  return BytesOfEdit(model) +
         kPixels * (static_cast<int64_t>(kMaxThingViews) * kBytesOfLook + kBytesOfRow);
}

}  // namespace pepeseg
