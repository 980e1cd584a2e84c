#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "core/sfm/two_view/relative_pose.h"
#include "kernels/cpu/parallel_for.h"

namespace pepeseg {

// Two photographs whose relative rotation is known.
struct ViewEdge {
  uint32_t first = 0, second = 0;
  RelativePose pose;           // of the second photograph relative to the first one
  bool has_direction = false;  // pose.translation means something: the rays have parallax
  std::vector<FeatureMatch> inliers;
};

// Computes the relative poses of pairs for known lenses. A general pair starts from its fundamental
// matrix, any other one from five points; then the Sampson distances of its inliers are
// minimised. Inliers that lie more than `max_error` pixels off are dropped, and pairs with fewer
// than 15 inliers left, too. A homography that is a rotation gives a rotation without a direction.
// Sorted by photographs; the same for any number of threads.
std::vector<ViewEdge> BuildViewGraph(std::span<const MapperPhotograph> photographs,
                                     std::span<const VerifiedPair> pairs,
                                     std::span<const GroupLens> lenses, double max_error,
                                     ThreadPool& pool);

// Returns for each photograph whether it is in the component with the most photographs. The first
// one among equals.
std::vector<bool> LargestComponent(size_t num_photographs, std::span<const ViewEdge> edges);

}  // namespace pepeseg
