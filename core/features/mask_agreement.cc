#include "core/features/mask_agreement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

#include "core/features/mask_scales.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

// A view sees a mask if it sees this share of its grid cells, and at least this many.
constexpr double kMinSeen = 0.5;
constexpr int kMinSeenCells = 6;
constexpr int kMinJudgingViews = 3;  // views that must see a mask that stands alone

// Counts the grid cells under the masks of a view and of one near view, among the cells that both
// views see.
class Overlaps {
 public:
  Overlaps(int num_own, int num_near)
      : num_near_(num_near),
        shared_(static_cast<size_t>(num_own) * num_near),
        own_(num_own),
        near_(num_near) {}

  // Adds a cell. own, near: bitsets of the masks over it in either view.
  void Add(std::span<const uint64_t> own, std::span<const uint64_t> near) {
    ForEachMaskIn(near, [&](int mask) { ++near_[mask]; });
    ForEachMaskIn(own, [&](int mask) {
      ++own_[mask];
      int* shared = shared_.data() + static_cast<size_t>(mask) * num_near_;
      ForEachMaskIn(near, [&](int other) { ++shared[other]; });
    });
  }

  // Returns how many cells of an own mask the near view sees.
  int num_seen(int own) const { return own_[own]; }
  // The mask of the near view with the best IoU with an own mask; the first of several.
  struct Match {
    int mask = -1;  // -1: none shares a cell with it
    float iou = 0;
  };
  Match BestMatch(int own) const {
    Match best;
    for (int other = 0; other < num_near_; ++other) {
      const int shared = shared_[static_cast<size_t>(own) * num_near_ + other];
      if (shared == 0) continue;
      const int all = own_[own] + near_[other] - shared;
      const float iou = static_cast<float>(shared) / static_cast<float>(all);
      if (iou > best.iou) best = {other, iou};
    }
    return best;
  }

 private:
  int num_near_;
  std::vector<int> shared_;      // [own masks, near masks] cells under both
  std::vector<int> own_, near_;  // cells by mask
};

// The cells of one view.
struct CountedView {
  std::vector<Overlaps> overlaps;  // by near view
  std::vector<int> num_cells;      // [num_masks] cells under each mask, seen elsewhere or not
};

CountedView Count(const Capture& capture, int number, const Reprojection& reprojection) {
  // A cell is a pixel of the grid on which Reprojection keeps depths, so that each has an exact
  // depth. About 65,536 cells a view bound the time.
  const View& view = capture.views[number];
  const MaskSet& masks = view.masks;
  const std::span<const int> near = reprojection.near(number);
  CountedView counted;
  for (const int other : near) {
    counted.overlaps.emplace_back(masks.num_masks, capture.views[other].masks.num_masks);
  }
  counted.num_cells.resize(masks.num_masks);
  const int stride = reprojection.stride(number);
  for (int y = 0; y < masks.height; y += stride) {
    for (int x = 0; x < masks.width; x += stride) {
      const int32_t pixel = y * masks.width + x;
      if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
      const std::span<const uint64_t> own = CellBits(masks, masks.pixel_cell[pixel]);
      ForEachMaskIn(own, [&](int mask) { ++counted.num_cells[mask]; });
      const Reprojection::Sight sight = reprojection.Look(number, pixel);
      for (size_t i = 0; i < near.size(); ++i) {
        if (sight[i] == Reprojection::kUnknown) continue;
        const MaskSet& others = capture.views[near[i]].masks;
        counted.overlaps[i].Add(own, CellBits(others, others.pixel_cell[sight[i]]));
      }
    }
  }
  return counted;
}

// near: the near views of the counted view.
MaskAgreement Agreement(const CountedView& counted, std::span<const int> near, int mask) {
  // The mean over the near views of the best IoU, weighted by the cells that each sees. It is 0
  // where no view sees enough of the mask: num_seen is then 0.
  MaskAgreement agreement;
  double sum = 0, weight = 0;
  for (size_t i = 0; i < near.size(); ++i) {
    const Overlaps& overlap = counted.overlaps[i];
    const int seen = overlap.num_seen(mask);
    if (seen < kMinSeenCells || seen < kMinSeen * counted.num_cells[mask]) continue;
    const Overlaps::Match best = overlap.BestMatch(mask);
    ++agreement.num_seen;
    agreement.num_same += best.iou >= kSameMask ? 1 : 0;
    if (best.iou >= kSameScale) agreement.same_scale.push_back({near[i], best.mask});
    sum += double{best.iou} * seen;
    weight += seen;
  }
  if (weight > 0) agreement.iou = static_cast<float>(sum / weight);
  return agreement;
}

}  // namespace

MaskAgreements MeasureMaskAgreement(const Capture& capture, const Reprojection& reprojection) {
  const std::span<const int> views = reprojection.views();
  MaskAgreements agreements(capture.views.size());
  ThreadPool pool(0);
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int) {
    const CountedView counted = Count(capture, views[i], reprojection);
    for (int mask = 0; mask < capture.views[views[i]].masks.num_masks; ++mask) {
      agreements[views[i]].push_back(Agreement(counted, reprojection.near(views[i]), mask));
    }
  });
  return agreements;
}

void ShareScales(const MaskAgreements& agreements, std::vector<std::vector<float>>& mask_scales) {
  const std::vector<std::vector<float>> measured = mask_scales;
  for (size_t view = 0; view < agreements.size(); ++view) {
    for (size_t mask = 0; mask < agreements[view].size(); ++mask) {
      if (measured[view][mask] <= kNoScale) continue;
      std::vector<float> scales = {measured[view][mask]};
      for (const MaskOfView& other : agreements[view][mask].same_scale) {
        const float scale = measured[other.view][other.mask];
        if (scale > kNoScale) scales.push_back(scale);
      }
      mask_scales[view][mask] = MedianScale(std::move(scales));
    }
  }
}

bool StandsAlone(const MaskAgreement& agreement, double min_agreement) {
  return agreement.num_seen >= kMinJudgingViews && double{agreement.iou} < min_agreement;
}

std::optional<double> MaskQuality(const Capture& capture, const MaskAgreements& agreements) {
  double sum = 0, weight = 0;
  for (size_t view = 0; view < agreements.size(); ++view) {
    for (size_t mask = 0; mask < agreements[view].size(); ++mask) {
      const MaskAgreement& agreement = agreements[view][mask];
      if (agreement.num_seen == 0) continue;
      // METHOD.md section 2: weighted by the root of the area. Masks that no view could judge do
      // not count.
      const double side = std::sqrt(static_cast<double>(capture.views[view].masks.mask_area[mask]));
      sum += side * double{agreement.iou};
      weight += side;
    }
  }
  if (weight == 0) return std::nullopt;
  return sum / weight;
}

}  // namespace pepeseg
