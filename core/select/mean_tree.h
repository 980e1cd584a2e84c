#pragma once

#include <cstdint>
#include <nanoflann.hpp>
#include <span>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// The nearest of some Gaussians to a place, by their means. What it is made of must outlive it.
class MeanTree {
 public:
  MeanTree(const Gaussians& gaussians, std::span<const int32_t> rows)
      : cloud_{gaussians, rows}, tree_(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  // Up to `num` positions in `rows`, nearest first, of those nearest to the mean of Gaussian `row`;
  // itself among them when it is one of the rows.
  std::vector<int32_t> Nearest(int32_t row, int num) const {
    std::vector<int32_t> found(static_cast<size_t>(num));
    std::vector<float> squared(found.size());
    const float mean[3] = {cloud_.At(row, 0), cloud_.At(row, 1), cloud_.At(row, 2)};
    found.resize(tree_.knnSearch(mean, found.size(), found.data(), squared.data()));
    return found;
  }

 private:
  struct Cloud {
    const Gaussians& gaussians;
    std::span<const int32_t> rows;

    float At(int32_t row, size_t axis) const {
      return gaussians.Plane(kMeanPlane + static_cast<int>(axis))[row];
    }
    size_t kdtree_get_point_count() const { return rows.size(); }
    float kdtree_get_pt(size_t i, size_t axis) const { return At(rows[i], axis); }
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

}  // namespace pepeseg
