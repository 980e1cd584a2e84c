#include "core/edit/nearest_points.h"

#include <cmath>
#include <cstdint>
#include <nanoflann.hpp>

namespace pepeseg {

struct NearestPoints::Tree {
  // The points as a data set of nanoflann.
  struct Cloud {
    std::vector<Eigen::Vector3d> points;

    size_t kdtree_get_point_count() const { return points.size(); }
    double kdtree_get_pt(size_t i, size_t axis) const {
      return points[i][static_cast<Eigen::Index>(axis)];
    }
    // Leaves the bounding box to nanoflann.
    template <class Box>
    bool kdtree_get_bbox(Box& /*box*/) const {
      return false;
    }
  };
  using Index = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>,
                                                    Cloud, 3, uint32_t>;

  explicit Tree(std::span<const Eigen::Vector3d> points)
      : cloud{{points.begin(), points.end()}},
        index(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16)) {}

  const Cloud cloud;
  const Index index;
};

NearestPoints::NearestPoints(std::span<const Eigen::Vector3d> points)
    : tree_(std::make_unique<const Tree>(points)) {}

NearestPoints::~NearestPoints() = default;

NearestPoints::Found NearestPoints::Find(const Eigen::Vector3d& from) const {
  uint32_t index = 0;
  double squared = 0;
  tree_->index.knnSearch(from.data(), 1, &index, &squared);
  return {index, std::sqrt(squared)};
}

}  // namespace pepeseg
