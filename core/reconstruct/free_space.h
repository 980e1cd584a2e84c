#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/scene/capture.h"
#include "kernels/ops/render.h"

namespace pepeseg {

// The space around the training cameras in which nothing can be (METHOD.md section 1, "Free
// space"). A Gaussian there floats before the cameras of other views, which no photograph corrects.
// The points of the capture keep away from both parts:
//   - half balls in front of the cameras, and of places halfway between neighbouring ones, where a
//     camera was carried;
//   - what at most one photograph shows of larger balls around the cameras.
class FreeSpace {
 public:
  // clearance: largest radius of a ball, scene radii. 0, or a capture without points: empty.
  FreeSpace(const Capture& capture, double clearance);

  bool empty() const { return balls_.empty(); }
  // Returns whether a point, world coordinates, is in the space. False if a coordinate is NaN.
  bool Contains(const Eigen::Vector3f& point) const;

 private:
  struct Ball {
    Eigen::Vector3f center, forward;  // of a camera; `forward` has the length 1
    float radius;
    // True: the half in front. False: all of it that at most one photograph shows.
    bool is_half;
  };
  bool IsHardlySeen(const Eigen::Vector3f& point) const;
  // The cell of a grid over all balls in which a point lies, or -1 outside of the grid.
  int64_t CellOf(const Eigen::Vector3f& point) const;
  void MakeGrid();

  std::vector<Ball> balls_;
  std::vector<PinholeView> views_;  // the training views
  // Balls by the cells that they may reach: those of cell c are ball_of_[cell_first_[c] ..
  // cell_first_[c + 1]).
  Eigen::Vector3f corner_ = Eigen::Vector3f::Zero();
  float cell_size_ = 1;
  std::array<int, 3> num_cells_{};
  std::vector<int32_t> cell_first_, ball_of_;
};

}  // namespace pepeseg
