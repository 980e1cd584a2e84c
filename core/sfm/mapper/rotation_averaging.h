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

// Averages relative rotations. Drops edges whose every triangle closes worse than 5 degrees, starts
// from the spanning tree of the most inliers, and minimises the residuals on so(3), first in the L1
// norm, then with weights that fade out outliers (Chatterjee and Govindu 2013; both by iteratively
// reweighted least squares). Then drops edges that are off by more than 5 degrees and repeats
// once. The first known photograph has the identity.
AveragedRotations AverageRotations(size_t num_photographs, std::vector<ViewEdge> edges);

}  // namespace pepeseg
