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
// Another pose of a pair counts if it fits this share of the best pose's matches.
constexpr double kAlternativeShare = 0.75;
constexpr double kSameRotation = 1.5 * std::numbers::pi / 180;
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
    if (std::optional<ViewPose> turn = Turn()) {
      return ViewEdge{pair_.first, pair_.second, *std::move(turn), {}};
    }
    std::vector<ViewPose> found;
    Add(FromFundamental(), found);
    for (const Eigen::Matrix3d& essential : PlaneEssentials()) Add(Finish(essential), found);
    if (found.empty() || static_cast<double>(found.front().inliers.size()) <
                             kLeastShare * static_cast<double>(matches_.pairs.size())) {
      Add(FromFivePoints(), found);
    }
    if (found.empty() || found.front().inliers.size() < kFewestInliers) return std::nullopt;
    ViewEdge edge{pair_.first, pair_.second, std::move(found.front()), {}};
    const double least = kAlternativeShare * static_cast<double>(edge.view.inliers.size());
    for (size_t i = 1; i < found.size(); ++i) {
      if (found[i].inliers.size() < kFewestInliers) continue;
      if (static_cast<double>(found[i].inliers.size()) < least) continue;
      edge.others.push_back(std::move(found[i]));
    }
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

  std::optional<ViewPose> Turn() const;
  std::optional<ViewPose> FromFundamental() const;
  std::vector<Eigen::Matrix3d> PlaneEssentials() const;
  std::optional<ViewPose> FromFivePoints() const;
  std::optional<ViewPose> Finish(const Eigen::Matrix3d& essential) const;
  static void Add(std::optional<ViewPose> view, std::vector<ViewPose>& found);

  std::span<const MapperPhotograph> photographs_;
  const VerifiedPair& pair_;
  std::span<const GroupLens> lenses_;
  NormalisedMatches matches_;
  double threshold_;
  MagsacLoss loss_, wide_;
};

// Adds a pose in the order of the number of inliers, unless a better one has nearly its rotation.
void PairPose::Add(std::optional<ViewPose> view, std::vector<ViewPose>& found) {
  if (!view) return;
  const auto is_same = [&](const ViewPose& other) {
    return RotationAngle(other.pose.rotation.transpose() * view->pose.rotation) < kSameRotation;
  };
  const auto is_fewer = [&](const ViewPose& other) {
    return other.inliers.size() < view->inliers.size();
  };
  const auto place = std::find_if(found.begin(), found.end(), is_fewer);
  if (std::any_of(found.begin(), place, is_same)) return;
  const auto index = place - found.begin();
  found.erase(std::remove_if(place, found.end(), is_same), found.end());
  found.insert(found.begin() + index, *std::move(view));
}

std::optional<ViewPose> PairPose::Turn() const {
  const TwoViewCameras cameras{CameraOf(pair_.first), CameraOf(pair_.second)};
  if (!IsFlat() || !IsPureRotation(pair_.geometry.homography, cameras, kMaxDeviation)) {
    return std::nullopt;
  }
  const Eigen::Matrix3d turn = CameraMatrix(cameras.second).inverse() * pair_.geometry.homography *
                               CameraMatrix(cameras.first);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turn, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) rotation = -rotation;
  return ViewPose{{rotation, Eigen::Vector3d::Zero()}, false, pair_.geometry.inliers};
}

// Returns the essential matrices of both motions that the pair's homography allows.
std::vector<Eigen::Matrix3d> PairPose::PlaneEssentials() const {
  if (pair_.geometry.homography.isZero()) return {};
  Eigen::Matrix3d h = CameraMatrix(CameraOf(pair_.second)).inverse() * pair_.geometry.homography *
                      CameraMatrix(CameraOf(pair_.first));
  if (h.determinant() < 0) h = -h;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(h, Eigen::ComputeFullV);
  const Eigen::Vector3d s = svd.singularValues() / svd.singularValues()[1];
  h /= svd.singularValues()[1];
  const double across = std::sqrt(std::max(0.0, 1 - s[2] * s[2]));
  const double along = std::sqrt(std::max(0.0, s[0] * s[0] - 1));
  const double length = std::hypot(across, along);
  if (!(length > 1e-6)) return {};
  const Eigen::Vector3d v = svd.matrixV().col(1);
  std::vector<Eigen::Matrix3d> essentials;
  for (const double sign : {1.0, -1.0}) {
    // Two directions of the plane that keep their length.
    const Eigen::Vector3d u =
        (across * svd.matrixV().col(0) + sign * along * svd.matrixV().col(2)) / length;
    Eigen::Matrix3d from, to;
    from << v, u, v.cross(u);
    to << h * v, h * u, (h * v).cross(h * u);
    const Eigen::Matrix3d rotation = to * from.transpose();
    const Eigen::Vector3d translation = (h - rotation) * v.cross(u);
    essentials.push_back(EssentialMatrix({rotation, translation.stableNormalized()}));
  }
  return essentials;
}

std::optional<ViewPose> PairPose::FromFundamental() const {
  if (pair_.geometry.fundamental.isZero()) return std::nullopt;
  return Finish(CameraMatrix(CameraOf(pair_.second)).transpose() * pair_.geometry.fundamental *
                CameraMatrix(CameraOf(pair_.first)));
}

std::optional<ViewPose> PairPose::FromFivePoints() const {
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
std::optional<ViewPose> PairPose::Finish(const Eigen::Matrix3d& essential) const {
  const std::optional<CheiralPose> start = DecomposeEssential(essential, matches_.pairs);
  if (!start) return std::nullopt;
  ViewPose view{Refine(start->pose, matches_.pairs, wide_, loss_), false, {}};
  const Eigen::Matrix3d refined = EssentialMatrix(view.pose);
  std::vector<double> angles;
  for (size_t i = 0; i < matches_.pairs.size(); ++i) {
    const PointPair& pair = matches_.pairs[i];
    if (!(SampsonSquared(refined, pair) < threshold_ * threshold_)) continue;
    const Eigen::Vector3d u = view.pose.rotation * pair.first.homogeneous();
    const Eigen::Vector3d v = pair.second.homogeneous();
    const double angle = std::atan2(u.cross(v).norm(), u.dot(v));
    // Behind a camera, and not merely far away.
    const double to_first =
        std::atan2(u.cross(view.pose.translation).norm(), -u.dot(view.pose.translation));
    const double to_second =
        std::atan2(v.cross(view.pose.translation).norm(), v.dot(view.pose.translation));
    if (to_first + to_second > std::numbers::pi + 2 * threshold_) continue;
    angles.push_back(angle);
    view.inliers.push_back(pair_.geometry.inliers[i]);
  }
  if (angles.empty()) return std::nullopt;
  std::nth_element(angles.begin(), angles.begin() + angles.size() / 2, angles.end());
  view.has_direction = angles[angles.size() / 2] > kLeastParallax;
  return view;
}

// Disjoint sets of photographs.
class PhotographSets {
 public:
  explicit PhotographSets(size_t num_photographs) : root_(num_photographs) {
    std::iota(root_.begin(), root_.end(), 0);
  }
  uint32_t Find(uint32_t i) {
    while (root_[i] != i) i = root_[i] = root_[root_[i]];
    return i;
  }
  // Returns false if both are in one set already.
  bool Join(uint32_t first, uint32_t second) {
    const uint32_t a = Find(first), b = Find(second);
    root_[std::max(a, b)] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<uint32_t> root_;
};

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

std::vector<ViewEdge> StrongEdges(size_t num_photographs, std::span<const ViewEdge> edges,
                                  double share) {
  std::vector<double> best(num_photographs, 0);
  std::vector<size_t> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  const auto count = [&](size_t i) { return static_cast<double>(edges[i].view.inliers.size()); };
  for (size_t i = 0; i < edges.size(); ++i) {
    best[edges[i].first] = std::max(best[edges[i].first], count(i));
    best[edges[i].second] = std::max(best[edges[i].second], count(i));
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return count(a) > count(b); });
  PhotographSets sets(num_photographs);
  std::vector<bool> is_strong(edges.size());
  for (const size_t i : order) {
    const bool joins = sets.Join(edges[i].first, edges[i].second);
    is_strong[i] =
        joins || count(i) >= share * std::max(best[edges[i].first], best[edges[i].second]);
  }
  std::vector<ViewEdge> strong;
  for (size_t i = 0; i < edges.size(); ++i) {
    if (is_strong[i]) strong.push_back(edges[i]);
  }
  return strong;
}

std::vector<bool> LargestComponent(size_t num_photographs, std::span<const ViewEdge> edges) {
  PhotographSets sets(num_photographs);
  for (const ViewEdge& edge : edges) sets.Join(edge.first, edge.second);
  std::vector<size_t> sizes(num_photographs, 0);
  for (uint32_t i = 0; i < num_photographs; ++i) ++sizes[sets.Find(i)];
  const auto largest =
      static_cast<uint32_t>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<bool> is_member(num_photographs);
  for (uint32_t i = 0; i < num_photographs; ++i) is_member[i] = sets.Find(i) == largest;
  return is_member;
}

}  // namespace pepeseg
