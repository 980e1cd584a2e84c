#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/sfm/mapper/view_graph.h"

namespace pepeseg {

// Rotations of photographs, world to camera, and the edges that agree with them.
struct AveragedRotations {
  std::vector<Eigen::Matrix3d> rotations;  // by photograph
  std::vector<bool> is_known;              // by photograph: in the largest component
  std::vector<ViewEdge> edges;             // between known photographs
};

// Averages relative rotations. Three times: chooses the poses of ambiguous edges by triangles
// (ChoosePoses) and drops edges whose every triangle closes worse than 5 degrees; starts from the
// spanning tree of the most inliers; minimises the residuals on so(3), weighted by the inliers,
// first in the L1 norm, then with weights that fade out outliers (Chatterjee and Govindu 2013; both
// by iteratively reweighted least squares), always of the closest pose of an edge; drops edges that
// are off by more than 5 degrees. The first known photograph has the identity. The same for any
// number of threads.
AveragedRotations AverageRotations(size_t num_photographs, std::vector<ViewEdge> edges,
                                   ThreadPool& pool);

}  // namespace pepeseg
