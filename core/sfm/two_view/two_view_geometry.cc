#include "core/sfm/two_view/two_view_geometry.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "core/sfm/two_view/two_view_problems.h"

namespace pepeseg {
namespace {

// Largest absolute coordinate, pixels. Photographs are far smaller.
constexpr double kLargestCoordinate = 1e6;
// Border of a watermark as a share of the diagonal, and the shares of inliers that are in the
// border and that moved by one shift (as in COLMAP).
constexpr double kBorder = 0.1, kBorderShare = 0.7, kShiftShare = 0.7;

// The loss ends at this multiple of the largest error: a sample of noisy inliers is recognised more
// often (100 scenes with 65 % outliers: 34 missed, 42 with a factor of 1).
constexpr double kLossLimit = 1.5;

// The usable matches, and which distinct pair of points each one is.
struct DistinctPairs {
  std::vector<PointPair> pairs;
  std::vector<FeatureMatch> matches;  // usable ones
  std::vector<uint32_t> pair_of;      // index into `pairs` of each match
};

bool IsUsable(const Keypoint& keypoint) {
  return std::abs(keypoint.x) <= kLargestCoordinate && std::abs(keypoint.y) <= kLargestCoordinate;
}

DistinctPairs CollectPairs(std::span<const Keypoint> first, std::span<const Keypoint> second,
                           std::span<const FeatureMatch> matches) {
  DistinctPairs distinct;
  std::vector<std::array<float, 4>> positions;
  for (const FeatureMatch& match : matches) {
    if (match.first >= first.size() || match.second >= second.size()) continue;
    const Keypoint &a = first[match.first], &b = second[match.second];
    if (!IsUsable(a) || !IsUsable(b)) continue;
    distinct.matches.push_back(match);
    positions.push_back({a.x, a.y, b.x, b.y});
  }
  std::vector<uint32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return positions[a] < positions[b]; });
  distinct.pair_of.resize(order.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const std::array<float, 4>& p = positions[order[i]];
    if (i == 0 || p != positions[order[i - 1]])
      distinct.pairs.push_back({{p[0], p[1]}, {p[2], p[3]}});
    distinct.pair_of[order[i]] = static_cast<uint32_t>(distinct.pairs.size() - 1);
  }
  return distinct;
}

// Moves both photographs' points to their means and scales both by the same factor, so that
// residuals keep their meaning.
struct Conditioning {
  Eigen::Vector2d first_mean = Eigen::Vector2d::Zero(), second_mean = Eigen::Vector2d::Zero();
  double scale = 1;

  explicit Conditioning(std::span<const PointPair> pairs) {
    for (const PointPair& pair : pairs) first_mean += pair.first, second_mean += pair.second;
    first_mean /= static_cast<double>(pairs.size());
    second_mean /= static_cast<double>(pairs.size());
    double sum = 0;
    for (const PointPair& pair : pairs) {
      sum += (pair.first - first_mean).squaredNorm() + (pair.second - second_mean).squaredNorm();
    }
    scale = std::sqrt(4 * static_cast<double>(pairs.size()) / sum);
  }

  static Eigen::Matrix3d Matrix(const Eigen::Vector2d& mean, double scale) {
    Eigen::Matrix3d m = Eigen::Matrix3d::Identity();
    m.topLeftCorner<2, 2>() *= scale;
    m.topRightCorner<2, 1>() = -scale * mean;
    return m;
  }
  Eigen::Matrix3d First() const { return Matrix(first_mean, scale); }
  Eigen::Matrix3d Second() const { return Matrix(second_mean, scale); }
  PointPair Apply(const PointPair& pair) const {
    return {scale * (pair.first - first_mean), scale * (pair.second - second_mean)};
  }
};

// A matrix in conditioned coordinates with its inliers among the distinct pairs.
struct Fit {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  std::vector<uint32_t> inliers;

  size_t count() const { return inliers.size(); }
};

template <typename Problem>
Fit FitMatrix(const Problem& problem, const MagsacLoss& loss, const RansacOptions& options,
              std::span<const uint32_t> pool) {
  LoRansac search(problem, loss, options);
  const std::optional<RansacModel> model = search.Run(pool);
  if (!model) return {};
  return {model->matrix, search.Inliers(model->matrix)};
}

// Returns whether points are on a line or at one place: their smaller deviation is below `least`.
bool AreCollinear(std::span<const PointPair> pairs, std::span<const uint32_t> indices,
                  Eigen::Vector2d PointPair::*side, double least) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const uint32_t i : indices) mean += pairs[i].*side;
  mean /= static_cast<double>(indices.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const uint32_t i : indices) {
    const Eigen::Vector2d offset = pairs[i].*side - mean;
    scatter += offset * offset.transpose();
  }
  scatter /= static_cast<double>(indices.size());
  const double half = scatter.trace() / 2;
  const double smaller = half - std::sqrt(std::max(0.0, half * half - scatter.determinant()));
  return !(smaller > least * least);
}

bool IsInBorder(const Eigen::Vector2d& point, const TwoViewCamera& camera) {
  const double border = kBorder * std::hypot(camera.width, camera.height);
  return point.x() < border || point.y() < border || point.x() > camera.width - border ||
         point.y() > camera.height - border;
}

// Returns whether most inliers are in the borders of both photographs and moved by one shift.
bool IsWatermark(std::span<const PointPair> pairs, std::span<const uint32_t> indices,
                 const TwoViewCameras& cameras, double max_error) {
  if (cameras.first.width <= 0 || cameras.second.width <= 0) return false;
  const double num = static_cast<double>(indices.size());
  const auto in_border = std::count_if(indices.begin(), indices.end(), [&](uint32_t i) {
    return IsInBorder(pairs[i].first, cameras.first) && IsInBorder(pairs[i].second, cameras.second);
  });
  if (static_cast<double>(in_border) < kBorderShare * num) return false;
  // Each of up to 50 inliers proposes its own shift.
  const size_t stride = std::max<size_t>(1, indices.size() / 50);
  for (size_t k = 0; k < indices.size(); k += stride) {
    const Eigen::Vector2d shift = pairs[indices[k]].second - pairs[indices[k]].first;
    const auto shifted = std::count_if(indices.begin(), indices.end(), [&](uint32_t i) {
      return (pairs[i].second - pairs[i].first - shift).norm() < max_error;
    });
    if (static_cast<double>(shifted) >= kShiftShare * num) return true;
  }
  return false;
}

// A hash of the positions, so that each pair draws other samples whoever asks.
uint64_t SeedOf(std::span<const PointPair> pairs, uint64_t seed) {
  for (const PointPair& pair : pairs) {
    for (const double x : {pair.first.x(), pair.first.y(), pair.second.x(), pair.second.y()}) {
      seed = (std::rotl(seed, 5) ^ std::bit_cast<uint64_t>(x)) * 0x9e3779b97f4a7c15;
    }
  }
  return seed;
}

// The three matrices of one pair of photographs.
class Verification {
 public:
  Verification(const DistinctPairs& distinct, const TwoViewCameras& cameras,
               const TwoViewOptions& options)
      : distinct_(distinct),
        cameras_(cameras),
        options_(options),
        conditioning_(distinct.pairs),
        loss_(kLossLimit * options.max_error * conditioning_.scale) {
    for (const PointPair& pair : distinct.pairs) pairs_.push_back(conditioning_.Apply(pair));
  }

  // Returns false if the points do not have a scale, because all are at one place.
  bool IsConditioned() const {
    return std::isfinite(conditioning_.scale) && conditioning_.scale < 1 / options_.max_error;
  }

  void FitAll() {
    std::vector<uint32_t> all(pairs_.size());
    std::iota(all.begin(), all.end(), 0);
    RansacOptions ransac{options_.max_error * conditioning_.scale, options_.max_trials,
                         options_.confidence, SeedOf(pairs_, options_.seed)};
    f_ = FitMatrix(FundamentalProblem(pairs_), loss_, ransac, all);
    // A homography that decides anything has this share of the pairs, and shows in fewer trials.
    const double share = options_.max_homography_share * static_cast<double>(f_.count()) /
                         static_cast<double>(pairs_.size());
    ransac.max_trials = static_cast<int>(std::min<double>(
        options_.max_trials,
        std::ceil(NumTrials(share, HomographyProblem::kSampleSize, options_.confidence))));
    h_ = FitMatrix(HomographyProblem(pairs_), loss_, ransac, all);
    if (HasFocals()) FitEssential(ransac);
  }

  TwoViewGeometry Decide() const;

 private:
  bool HasFocals() const { return cameras_.first.focal > 0 && cameras_.second.focal > 0; }
  void FitEssential(const RansacOptions& ransac);
  TwoViewKind FlatKind(const Eigen::Matrix3d& homography) const;

  const DistinctPairs& distinct_;
  const TwoViewCameras& cameras_;
  const TwoViewOptions& options_;
  Conditioning conditioning_;
  MagsacLoss loss_;
  std::vector<PointPair> pairs_;  // conditioned
  Fit f_, h_, e_;
};

// Draws samples among the inliers of F and H, of which few are wrong: the 5-point solver is the
// slowest. The loss is that of all pairs.
void Verification::FitEssential(const RansacOptions& ransac) {
  std::vector<uint32_t> pool;
  std::set_union(f_.inliers.begin(), f_.inliers.end(), h_.inliers.begin(), h_.inliers.end(),
                 std::back_inserter(pool));
  const Eigen::Matrix3d first = CameraMatrix(cameras_.first).inverse();
  const Eigen::Matrix3d second = CameraMatrix(cameras_.second).inverse();
  std::vector<PointPair> normalised;
  for (const PointPair& pair : distinct_.pairs) {
    normalised.push_back({(first * pair.first.homogeneous()).hnormalized(),
                          (second * pair.second.homogeneous()).hnormalized()});
  }
  const EssentialProblem problem(pairs_, normalised, first * conditioning_.First().inverse(),
                                 second * conditioning_.Second().inverse());
  e_ = FitMatrix(problem, loss_, ransac, pool);
}

TwoViewKind Verification::FlatKind(const Eigen::Matrix3d& homography) const {
  if (!HasFocals()) return TwoViewKind::kPlanarOrPanoramic;
  return IsPureRotation(homography, cameras_, options_.max_rotation_deviation)
             ? TwoViewKind::kPanoramic
             : TwoViewKind::kPlanar;
}

TwoViewGeometry Verification::Decide() const {
  TwoViewGeometry result;
  const bool calibrated =
      HasFocals() && static_cast<double>(e_.count()) >
                         options_.min_essential_share * static_cast<double>(f_.count());
  const Fit* chosen = calibrated ? &e_ : &f_;
  const bool flat = static_cast<double>(h_.count()) >
                    options_.max_homography_share * static_cast<double>(chosen->count());
  if (flat && h_.count() > chosen->count()) chosen = &h_;
  if (static_cast<int>(chosen->count()) < options_.min_inliers) return result;
  for (const auto side : {&PointPair::first, &PointPair::second}) {
    if (AreCollinear(distinct_.pairs, chosen->inliers, side, options_.max_error)) return result;
  }
  const Eigen::Matrix3d first = conditioning_.First(), second = conditioning_.Second();
  // Zero matrices stay zero: stableNormalized leaves them.
  result.fundamental = (second.transpose() * f_.matrix * first).stableNormalized();
  result.homography = (second.inverse() * h_.matrix * first).stableNormalized();
  result.essential = e_.matrix;
  if (!result.fundamental.allFinite() || !result.homography.allFinite()) return {};
  result.kind = flat         ? FlatKind(result.homography)
                : calibrated ? TwoViewKind::kCalibrated
                             : TwoViewKind::kUncalibrated;
  if (IsWatermark(distinct_.pairs, chosen->inliers, cameras_, options_.max_error)) {
    result.kind = TwoViewKind::kWatermark;
  }
  std::vector<bool> is_inlier(distinct_.pairs.size());
  for (const uint32_t i : chosen->inliers) is_inlier[i] = true;
  for (size_t m = 0; m < distinct_.matches.size(); ++m) {
    if (is_inlier[distinct_.pair_of[m]]) result.inliers.push_back(distinct_.matches[m]);
  }
  return result;
}

}  // namespace

TwoViewGeometry EstimateTwoViewGeometry(std::span<const Keypoint> first,
                                        std::span<const Keypoint> second,
                                        std::span<const FeatureMatch> matches,
                                        const TwoViewCameras& cameras,
                                        const TwoViewOptions& options) {
  const DistinctPairs distinct = CollectPairs(first, second, matches);
  if (static_cast<int>(distinct.pairs.size()) < std::max(options.min_inliers, 1)) return {};
  Verification verification(distinct, cameras, options);
  if (!verification.IsConditioned()) return {};
  verification.FitAll();
  return verification.Decide();
}

Eigen::Matrix3d CameraMatrix(const TwoViewCamera& camera) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = k(1, 1) = camera.focal;
  k(0, 2) = camera.width / 2.0;
  k(1, 2) = camera.height / 2.0;
  return k;
}

bool IsPureRotation(const Eigen::Matrix3d& homography, const TwoViewCameras& cameras,
                    double max_deviation) {
  const Eigen::Matrix3d turn =
      CameraMatrix(cameras.second).inverse() * homography * CameraMatrix(cameras.first);
  const double size = std::cbrt(std::abs(turn.determinant()));
  if (!turn.allFinite() || !(size > 0)) return false;
  const Eigen::Vector3d values = Eigen::JacobiSVD<Eigen::Matrix3d>(turn).singularValues() / size;
  return (values.array() - 1).abs().maxCoeff() < max_deviation;
}

}  // namespace pepeseg
