#pragma once

#include <cstdint>
#include <nanoflann.hpp>
#include <span>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// Returns the connected part of each of the `selected` Gaussians (indices into `gaussians`, without
// repeats): 0, 1, ... in the order in which the parts appear in `selected`.
//
// A Gaussian is connected to those of its 16 nearest selected neighbours that it touches. Two
// Gaussians touch if their ellipsoids of 3 standard deviations, to which splats are drawn, together
// reach from one mean to the other along the line between them.
std::vector<int32_t> ConnectedParts(const Gaussians& gaussians, std::span<const int32_t> selected);

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

}  // namespace pepeseg
