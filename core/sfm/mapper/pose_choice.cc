#include "core/sfm/mapper/pose_choice.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pepeseg {
namespace {

// Triangles that are looked at for each edge: those of the third photographs with the most matches.
constexpr size_t kMostTriangles = 60;
// A triangle counts half if it closes with the largest error over this.
constexpr double kSharpness = 5;

// An edge as one of its photographs sees it.
struct Neighbour {
  uint32_t photograph = 0, edge = 0;
};

// The edges of each photograph, by the other photograph.
class Neighbours {
 public:
  Neighbours(size_t num_photographs, std::span<const ViewEdge> edges)
      : edges_(edges), of_(num_photographs) {
    for (uint32_t i = 0; i < edges.size(); ++i) {
      of_[edges[i].first].push_back({edges[i].second, i});
      of_[edges[i].second].push_back({edges[i].first, i});
    }
    for (std::vector<Neighbour>& list : of_) {
      std::sort(list.begin(), list.end(),
                [](const Neighbour& a, const Neighbour& b) { return a.photograph < b.photograph; });
    }
  }

  // A third photograph, with the edges from the first and to the second photograph of an edge.
  struct Triangle {
    uint32_t third = 0, from = 0, to = 0;
    size_t num_inliers = 0;  // the smaller number of the two edges
  };

  // Returns the triangles of an edge, those with the most inliers first.
  std::vector<Triangle> TrianglesOf(const ViewEdge& edge) const {
    std::vector<Triangle> triangles;
    auto a = of_[edge.first].begin(), b = of_[edge.second].begin();
    while (a != of_[edge.first].end() && b != of_[edge.second].end()) {
      if (a->photograph < b->photograph) {
        ++a;
      } else if (b->photograph < a->photograph) {
        ++b;
      } else {
        triangles.push_back(
            {a->photograph, a->edge, b->edge,
             std::min(edges_[a->edge].view.inliers.size(), edges_[b->edge].view.inliers.size())});
        ++a, ++b;
      }
    }
    std::stable_sort(triangles.begin(), triangles.end(), [](const Triangle& x, const Triangle& y) {
      return x.num_inliers > y.num_inliers;
    });
    if (triangles.size() > kMostTriangles) triangles.resize(kMostTriangles);
    return triangles;
  }

 private:
  std::span<const ViewEdge> edges_;
  std::vector<std::vector<Neighbour>> of_;
};

// Returns the rotations of an edge's poses, from photograph `from` to the other one.
std::vector<Eigen::Matrix3d> RotationsFrom(const ViewEdge& edge, uint32_t from) {
  std::vector<Eigen::Matrix3d> rotations;
  const auto add = [&](const ViewPose& view) {
    rotations.push_back(edge.first == from ? view.pose.rotation
                                           : Eigen::Matrix3d(view.pose.rotation.transpose()));
  };
  add(edge.view);
  for (const ViewPose& other : edge.others) add(other);
  return rotations;
}

// Returns the smallest angle between the rotation `direct` and a way over the third photograph.
double ClosingAngle(const Eigen::Matrix3d& direct, std::span<const Eigen::Matrix3d> from,
                    std::span<const Eigen::Matrix3d> to) {
  double least = INFINITY;
  for (const Eigen::Matrix3d& turn : from) {
    for (const Eigen::Matrix3d& back : to) {
      least = std::min(least, RotationAngle(direct.transpose() * back * turn));
    }
  }
  return least;
}

void MakeFirst(size_t choice, ViewEdge& edge) {
  if (choice > 0) std::swap(edge.view, edge.others[choice - 1]);
}

}  // namespace

std::vector<TriangleSupport> ChoosePoses(size_t num_photographs, double max_error,
                                         std::span<ViewEdge> edges, ThreadPool& pool) {
  const Neighbours neighbours(num_photographs, edges);
  std::vector<TriangleSupport> supports(edges.size());
  std::vector<size_t> choices(edges.size(), 0);
  pool.ParallelFor(static_cast<int64_t>(edges.size()), [&](int64_t e, int) {
    const ViewEdge& edge = edges[e];
    const auto triangles = neighbours.TrianglesOf(edge);
    const std::vector<Eigen::Matrix3d> own = RotationsFrom(edge, edge.first);
    std::vector<double> support(own.size(), 0.0);
    for (const auto& triangle : triangles) {
      const auto from = RotationsFrom(edges[triangle.from], edge.first);
      const auto to = RotationsFrom(edges[triangle.to], triangle.third);
      for (size_t i = 0; i < own.size(); ++i) {
        const double angle = ClosingAngle(own[i], from, to);
        if (angle > max_error) continue;
        const double ratio = kSharpness * angle / max_error;
        support[i] += std::sqrt(static_cast<double>(triangle.num_inliers)) / (1 + ratio * ratio);
      }
    }
    const auto best = std::max_element(support.begin(), support.end());
    supports[e] = {static_cast<int>(triangles.size()), *best};
    choices[e] = static_cast<size_t>(best - support.begin());
  });
  for (size_t e = 0; e < edges.size(); ++e) MakeFirst(choices[e], edges[e]);
  return supports;
}

double ChooseClosest(const Eigen::Matrix3d& turn, ViewEdge& edge) {
  double least = RotationAngle(turn.transpose() * edge.view.pose.rotation);
  size_t choice = 0;
  for (size_t i = 0; i < edge.others.size(); ++i) {
    const double angle = RotationAngle(turn.transpose() * edge.others[i].pose.rotation);
    if (angle < least) least = angle, choice = i + 1;
  }
  MakeFirst(choice, edge);
  return least;
}

}  // namespace pepeseg
