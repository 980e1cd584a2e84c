#pragma once

#include <span>
#include <vector>

#include "core/sfm/mapper/global_model.h"
#include "core/sfm/two_view/relative_pose.h"
#include "kernels/thread_pool.h"

namespace pepeseg {

// A pose of the second photograph of a pair relative to the first one, and the matches that fit.
struct ViewPose {
  RelativePose pose;
  bool has_direction = false;  // pose.translation means something: the rays have parallax
  std::vector<FeatureMatch> inliers;
};

// Two photographs whose relative rotation is known.
struct ViewEdge {
  uint32_t first = 0, second = 0;
  ViewPose view;
  // Other poses that fit nearly as many matches: a plane has two. See ChoosePoses.
  std::vector<ViewPose> others;
};

// Computes the relative poses of pairs for known lenses. Starts are the pair's fundamental matrix,
// both poses of its homography (Ma et al. 2003, 5.3), and five points where these fit few matches;
// then the Sampson distances of the inliers are minimised. Inliers that lie more than `max_error`
// pixels off are dropped, and pairs with fewer than 15 inliers left, too. A homography that is a
// rotation gives a rotation without a direction. Sorted by photographs; the same for any number of
// threads.
std::vector<ViewEdge> BuildViewGraph(std::span<const MapperPhotograph> photographs,
                                     std::span<const VerifiedPair> pairs,
                                     std::span<const GroupLens> lenses, double max_error,
                                     ThreadPool& pool);

// Returns the edges whose number of inliers is at least `share` of that of the best edge of either
// photograph, and those of the maximum spanning forest, in the order of `edges`.
std::vector<ViewEdge> StrongEdges(size_t num_photographs, std::span<const ViewEdge> edges,
                                  double share);

// Returns for each photograph whether it is in the component with the most photographs. The first
// one among equals.
std::vector<bool> LargestComponent(size_t num_photographs, std::span<const ViewEdge> edges);

}  // namespace pepeseg
