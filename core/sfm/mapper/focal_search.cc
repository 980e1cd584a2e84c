#include "core/sfm/mapper/focal_search.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

constexpr int kNumCandidates = 120;
constexpr double kNarrowest = 20, kWidest = 120;  // fields of view, degrees
constexpr double kTemperature = 0.01;             // of the ratio of singular values, minus 1
constexpr int kFewestPairs = 10;
constexpr double kLeastContrast = 1.5;
constexpr double kMaxTurnDeviation = 0.02;  // see IsPureRotation
constexpr double kTurnShare = 0.8;

// Returns the focal length of a candidate as a share of the longer side; logarithmic steps.
double ShareOf(double index) {
  const auto focal = [](double degrees) {
    return 0.5 / std::tan(degrees * std::numbers::pi / 360);
  };
  return focal(kWidest) *
         std::pow(focal(kNarrowest) / focal(kWidest), index / (kNumCandidates - 1));
}

int LongerSide(const MapperPhotograph& photograph) {
  return std::max(photograph.width, photograph.height);
}

// A fundamental matrix whose coordinates start at the photographs' centres, with its weight.
struct Vote {
  Eigen::Matrix3d fundamental;
  double weight = 0;
};

Eigen::Matrix3d Shift(const MapperPhotograph& photograph) {
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift(0, 2) = photograph.width / 2.0;
  shift(1, 2) = photograph.height / 2.0;
  return shift;
}

// Returns the ratio of the two largest singular values of K' F K, at least 1.
double SingularRatio(const Eigen::Matrix3d& fundamental, double focal) {
  const Eigen::Vector3d k(focal, focal, 1);
  const Eigen::Matrix3d essential = (k.asDiagonal() * fundamental * k.asDiagonal()).normalized();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(essential.transpose() * essential, Eigen::EigenvaluesOnly);
  const double middle = solver.eigenvalues()[1];
  return middle > 0 ? std::sqrt(solver.eigenvalues()[2] / middle) : INFINITY;
}

bool IsGeneral(const TwoViewGeometry& geometry) {
  return geometry.kind == TwoViewKind::kCalibrated || geometry.kind == TwoViewKind::kUncalibrated;
}

}  // namespace

FocalEstimate SearchFocal(std::span<const MapperPhotograph> photographs,
                          std::span<const VerifiedPair> pairs, int camera_group) {
  std::vector<Vote> votes;
  double side = 0;
  for (const VerifiedPair& pair : pairs) {
    const MapperPhotograph &a = photographs[pair.first], &b = photographs[pair.second];
    if (a.camera_group != camera_group || b.camera_group != camera_group) continue;
    if (!IsGeneral(pair.geometry) || pair.geometry.fundamental.isZero()) continue;
    side = LongerSide(a);
    votes.push_back({Shift(b).transpose() * pair.geometry.fundamental * Shift(a),
                     static_cast<double>(pair.geometry.inliers.size())});
  }
  FocalEstimate estimate;
  estimate.num_pairs = static_cast<int>(votes.size());
  if (votes.empty()) return estimate;
  std::vector<double> scores(kNumCandidates, 0.0);
  for (int i = 0; i < kNumCandidates; ++i) {
    for (const Vote& vote : votes) {
      const double ratio = SingularRatio(vote.fundamental, side * ShareOf(i));
      scores[i] += vote.weight * std::exp((1 - ratio) / kTemperature);
    }
  }
  const auto best =
      static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  double offset = 0;
  const bool inside = best > 0 && best + 1 < kNumCandidates;
  if (inside) {
    // The peak of the parabola through three scores.
    const double left = scores[best - 1], right = scores[best + 1];
    const double bend = left - 2 * scores[best] + right;
    if (bend < 0) offset = std::clamp(0.5 * (left - right) / bend, -0.5, 0.5);
  }
  std::vector<double> sorted = scores;
  std::nth_element(sorted.begin(), sorted.begin() + kNumCandidates / 2, sorted.end());
  estimate.focal = side * ShareOf(best + offset);
  estimate.contrast = scores[best] / std::max(sorted[kNumCandidates / 2], 1e-12 * scores[best]);
  estimate.is_reliable =
      inside && estimate.num_pairs >= kFewestPairs && estimate.contrast >= kLeastContrast;
  return estimate;
}

bool TurnsOnTheSpot(std::span<const MapperPhotograph> photographs,
                    std::span<const VerifiedPair> pairs, std::span<const double> focals) {
  double all = 0, most = 0;
  for (const VerifiedPair& pair : pairs) all += static_cast<double>(pair.geometry.inliers.size());
  for (int i = 0; i < kNumCandidates; ++i) {
    double turned = 0;
    for (const VerifiedPair& pair : pairs) {
      // A general pair may have a homography by chance: it is not a turn on the spot.
      if (IsGeneral(pair.geometry)) continue;
      const MapperPhotograph &a = photographs[pair.first], &b = photographs[pair.second];
      const auto camera = [&](const MapperPhotograph& photograph) {
        const double known = focals[photograph.camera_group];
        return TwoViewCamera{photograph.width, photograph.height,
                             known > 0 ? known : LongerSide(photograph) * ShareOf(i)};
      };
      if (IsPureRotation(pair.geometry.homography, {camera(a), camera(b)}, kMaxTurnDeviation)) {
        turned += static_cast<double>(pair.geometry.inliers.size());
      }
    }
    most = std::max(most, turned);
  }
  return all > 0 && most >= kTurnShare * all;
}

}  // namespace pepeseg
