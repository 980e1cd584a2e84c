#include "core/features/neighbor_graph.h"

#include <algorithm>
#include <nanoflann.hpp>
#include <span>

#include "kernels/cpu/parallel_for.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 1024;  // Gaussians per task
constexpr size_t kLeafSize = 16;

// The means as a data set of nanoflann, which reads them in place.
struct MeanCloud {
  const Gaussians& gaussians;

  size_t kdtree_get_point_count() const { return static_cast<size_t>(gaussians.count); }
  float kdtree_get_pt(size_t i, size_t axis) const {
    return gaussians.Plane(kMeanPlane + static_cast<int>(axis))[i];
  }
  // Leaves the bounding box to nanoflann.
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, MeanCloud>,
                                                   MeanCloud, 3, int32_t>;

// Fills in the neighbours of Gaussian i. Of several Gaussians with the same mean the search may
// return any first, or leave out i itself: then i replaces the last one found.
void FindNeighbors(const KdTree& tree, const MeanCloud& cloud, int32_t i,
                   std::span<int32_t> neighbors) {
  float squared[kMaxNeighbors];
  const float mean[3] = {cloud.kdtree_get_pt(i, 0), cloud.kdtree_get_pt(i, 1),
                         cloud.kdtree_get_pt(i, 2)};
  // With fewer Gaussians than neighbours, the rest of the list repeats the Gaussian itself.
  std::fill(neighbors.begin(), neighbors.end(), i);
  const size_t found = tree.knnSearch(mean, neighbors.size(), neighbors.data(), squared);
  const auto end = neighbors.begin() + static_cast<int64_t>(found);
  const auto self = std::find(neighbors.begin(), end, i);
  // Moves i, or the last one found, to the front; the others keep their order by distance.
  std::rotate(neighbors.begin(), self == end ? end - 1 : self, self == end ? end : self + 1);
  neighbors[0] = i;
}

}  // namespace

std::vector<int32_t> NearestNeighbors(const Gaussians& gaussians, int num_neighbors) {
  std::vector<int32_t> neighbors(gaussians.count * num_neighbors);
  if (gaussians.count == 0) return neighbors;
  const MeanCloud cloud = {gaussians};
  const KdTree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize));
  ThreadPool pool(0);
  pool.ParallelFor((gaussians.count + kChunk - 1) / kChunk, [&](int64_t chunk, int) {
    for (int64_t i = chunk * kChunk; i < std::min(gaussians.count, (chunk + 1) * kChunk); ++i) {
      FindNeighbors(tree, cloud, static_cast<int32_t>(i),
                    std::span(neighbors).subspan(i * num_neighbors, num_neighbors));
    }
  });
  return neighbors;
}

}  // namespace pepeseg
