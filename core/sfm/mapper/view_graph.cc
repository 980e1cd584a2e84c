#include "core/sfm/mapper/view_graph.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "core/sfm/two_view/two_view_problems.h"

namespace pepeseg {
namespace {

constexpr size_t kFewestInliers = 15;
constexpr double kMaxDeviation = 0.02;  // see IsPureRotation
// A fundamental matrix whose pose fits a smaller share of its inliers is not trusted.
constexpr double kLeastShare = 0.7;
constexpr double kLeastParallax = 0.01;  // radians

// Pairs of points on the plane z = 1, and how long a pixel is there.
struct NormalisedMatches {
  std::vector<PointPair> pairs;
  double pixel = 0;
};

NormalisedMatches Normalise(std::span<const MapperPhotograph> photographs, const VerifiedPair& pair,
                            std::span<const GroupLens> lenses) {
  const GroupLens& a = lenses[photographs[pair.first].camera_group];
  const GroupLens& b = lenses[photographs[pair.second].camera_group];
  NormalisedMatches matches;
  matches.pixel = 2 / (a.focal + b.focal);
  for (const FeatureMatch& match : pair.geometry.inliers) {
    matches.pairs.push_back({a.Normalised(PixelOf(photographs, {pair.first, match.first})),
                             b.Normalised(PixelOf(photographs, {pair.second, match.second}))});
  }
  return matches;
}

std::vector<double> Weights(const RelativePose& pose, std::span<const PointPair> pairs,
                            const MagsacLoss& loss) {
  const Eigen::Matrix3d essential = EssentialMatrix(pose);
  std::vector<double> weights;
  for (const PointPair& pair : pairs) {
    weights.push_back(loss.Weight(SampsonSquared(essential, pair)));
  }
  return weights;
}

RelativePose Refine(RelativePose pose, std::span<const PointPair> pairs, const MagsacLoss& wide,
                    const MagsacLoss& loss) {
  pose = RefineRelativePose(pose, pairs, Weights(pose, pairs, wide), 5);
  pose = RefineRelativePose(pose, pairs, Weights(pose, pairs, loss), 5);
  return RefineRelativePose(pose, pairs, Weights(pose, pairs, loss), 5);
}

// Estimates the relative pose of one pair. Nothing if there is none with enough inliers.
class PairPose {
 public:
  PairPose(std::span<const MapperPhotograph> photographs, const VerifiedPair& pair,
           std::span<const GroupLens> lenses, double max_error)
      : photographs_(photographs),
        pair_(pair),
        lenses_(lenses),
        matches_(Normalise(photographs, pair, lenses)),
        threshold_(max_error * matches_.pixel),
        loss_(threshold_),
        wide_(3 * threshold_) {}

  std::optional<ViewEdge> Estimate() const {
    if (pair_.geometry.kind == TwoViewKind::kDegenerate ||
        pair_.geometry.kind == TwoViewKind::kWatermark) {
      return std::nullopt;
    }
    if (std::optional<ViewEdge> turn = Turn()) return turn;
    std::optional<ViewEdge> edge = FromFundamental();
    if (!edge || static_cast<double>(edge->inliers.size()) <
                     kLeastShare * static_cast<double>(matches_.pairs.size())) {
      std::optional<ViewEdge> other = FromFivePoints();
      if (other && (!edge || other->inliers.size() > edge->inliers.size())) edge = other;
    }
    if (edge && edge->inliers.size() < kFewestInliers) return std::nullopt;
    return edge;
  }

 private:
  const GroupLens& LensOf(uint32_t photograph) const {
    return lenses_[photographs_[photograph].camera_group];
  }
  TwoViewCamera CameraOf(uint32_t photograph) const {
    const GroupLens& lens = LensOf(photograph);
    return {lens.width, lens.height, lens.focal};
  }
  bool IsFlat() const {
    return pair_.geometry.kind == TwoViewKind::kPlanar ||
           pair_.geometry.kind == TwoViewKind::kPanoramic ||
           pair_.geometry.kind == TwoViewKind::kPlanarOrPanoramic;
  }

  std::optional<ViewEdge> Turn() const;
  std::optional<ViewEdge> FromFundamental() const;
  std::optional<ViewEdge> FromFivePoints() const;
  std::optional<ViewEdge> Finish(const Eigen::Matrix3d& essential) const;

  std::span<const MapperPhotograph> photographs_;
  const VerifiedPair& pair_;
  std::span<const GroupLens> lenses_;
  NormalisedMatches matches_;
  double threshold_;
  MagsacLoss loss_, wide_;
};

std::optional<ViewEdge> PairPose::Turn() const {
  const TwoViewCameras cameras{CameraOf(pair_.first), CameraOf(pair_.second)};
  if (!IsFlat() || !IsPureRotation(pair_.geometry.homography, cameras, kMaxDeviation)) {
    return std::nullopt;
  }
  const Eigen::Matrix3d turn = CameraMatrix(cameras.second).inverse() * pair_.geometry.homography *
                               CameraMatrix(cameras.first);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turn, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) rotation = -rotation;
  return ViewEdge{pair_.first,
                  pair_.second,
                  {rotation, Eigen::Vector3d::Zero()},
                  false,
                  pair_.geometry.inliers};
}

std::optional<ViewEdge> PairPose::FromFundamental() const {
  if (IsFlat() || pair_.geometry.fundamental.isZero()) return std::nullopt;
  return Finish(CameraMatrix(CameraOf(pair_.second)).transpose() * pair_.geometry.fundamental *
                CameraMatrix(CameraOf(pair_.first)));
}

std::optional<ViewEdge> PairPose::FromFivePoints() const {
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const EssentialProblem problem(matches_.pairs, matches_.pairs, identity, identity);
  std::vector<uint32_t> all(matches_.pairs.size());
  std::iota(all.begin(), all.end(), 0);
  const RansacOptions options{threshold_, 100, 0.999, pair_.first * 1000003ull + pair_.second};
  const std::optional<RansacModel> model = LoRansac(problem, loss_, options).Run(all);
  if (!model) return std::nullopt;
  return Finish(model->matrix);
}

// Decomposes and refines an essential matrix and keeps the inliers in front of both cameras.
std::optional<ViewEdge> PairPose::Finish(const Eigen::Matrix3d& essential) const {
  const std::optional<CheiralPose> start = DecomposeEssential(essential, matches_.pairs);
  if (!start) return std::nullopt;
  ViewEdge edge{
      pair_.first, pair_.second, Refine(start->pose, matches_.pairs, wide_, loss_), false, {}};
  const Eigen::Matrix3d refined = EssentialMatrix(edge.pose);
  std::vector<double> angles;
  for (size_t i = 0; i < matches_.pairs.size(); ++i) {
    const PointPair& pair = matches_.pairs[i];
    if (!(SampsonSquared(refined, pair) < threshold_ * threshold_)) continue;
    const Eigen::Vector3d u = edge.pose.rotation * pair.first.homogeneous();
    const Eigen::Vector3d v = pair.second.homogeneous();
    const double angle = std::atan2(u.cross(v).norm(), u.dot(v));
    // Behind a camera, and not merely far away.
    const double to_first =
        std::atan2(u.cross(edge.pose.translation).norm(), -u.dot(edge.pose.translation));
    const double to_second =
        std::atan2(v.cross(edge.pose.translation).norm(), v.dot(edge.pose.translation));
    if (to_first + to_second > std::numbers::pi + 2 * threshold_) continue;
    angles.push_back(angle);
    edge.inliers.push_back(pair_.geometry.inliers[i]);
  }
  if (angles.empty()) return std::nullopt;
  std::nth_element(angles.begin(), angles.begin() + angles.size() / 2, angles.end());
  edge.has_direction = angles[angles.size() / 2] > kLeastParallax;
  return edge;
}

}  // namespace

std::vector<ViewEdge> BuildViewGraph(std::span<const MapperPhotograph> photographs,
                                     std::span<const VerifiedPair> pairs,
                                     std::span<const GroupLens> lenses, double max_error,
                                     ThreadPool& pool) {
  std::vector<std::optional<ViewEdge>> found(pairs.size());
  pool.ParallelFor(static_cast<int64_t>(pairs.size()), [&](int64_t i, int) {
    found[i] = PairPose(photographs, pairs[i], lenses, max_error).Estimate();
  });
  std::vector<ViewEdge> edges;
  for (std::optional<ViewEdge>& edge : found) {
    if (edge) edges.push_back(std::move(*edge));
  }
  std::stable_sort(edges.begin(), edges.end(), [](const ViewEdge& a, const ViewEdge& b) {
    return std::pair(a.first, a.second) < std::pair(b.first, b.second);
  });
  return edges;
}

std::vector<bool> LargestComponent(size_t num_photographs, std::span<const ViewEdge> edges) {
  std::vector<uint32_t> root(num_photographs);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const ViewEdge& edge : edges) {
    const uint32_t a = find(edge.first), b = find(edge.second);
    root[std::max(a, b)] = std::min(a, b);
  }
  std::vector<size_t> sizes(num_photographs, 0);
  for (uint32_t i = 0; i < num_photographs; ++i) ++sizes[find(i)];
  const auto largest =
      static_cast<uint32_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<bool> is_member(num_photographs);
  for (uint32_t i = 0; i < num_photographs; ++i) is_member[i] = find(i) == largest;
  return is_member;
}

}  // namespace pepeseg
