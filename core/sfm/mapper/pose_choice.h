#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/view_graph.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// How the rotations of an edge close triangles with those of other edges.
struct TriangleSupport {
  int num_triangles = 0;  // that were looked at
  double support = 0;     // of the best pose: sum over closed triangles of their least root of the
                          // number of inliers
};

// Makes that pose of each edge its first one whose rotation closes the most triangles: a false
// pose of a plane rarely does. Triangles close if their rotations multiply to less than
// `max_error` radians; any combination of poses of the two other edges may close them. Returns the
// support of each edge. The same for any number of threads.
std::vector<TriangleSupport> ChoosePoses(size_t num_photographs, double max_error,
                                         std::span<ViewEdge> edges, ThreadPool& pool);

// Makes that pose of an edge its first one whose rotation is closest to `turn`. Returns the angle
// between them, radians.
double ChooseClosest(const Eigen::Matrix3d& turn, ViewEdge& edge);

}  // namespace pepeseg
