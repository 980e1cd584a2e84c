#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

namespace pepeseg {

// Finds the nearest of some points. Thread safe.
class NearestPoints {
 public:
  // There must be a point.
  explicit NearestPoints(std::span<const Eigen::Vector3d> points);
  ~NearestPoints();

  struct Found {
    size_t index = 0;  // of the point
    double distance = 0;
  };
  Found Find(const Eigen::Vector3d& from) const;

 private:
  struct Tree;
  std::unique_ptr<const Tree> tree_;
};

}  // namespace pepeseg
