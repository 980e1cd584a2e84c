#include "core/edit/support_planes.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <ranges>

#include "core/base/order_statistics.h"
#include "core/edit/nearest_points.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxPlanes = 3;
constexpr size_t kMaxCandidates = 8192, kMaxThingPoints = 4096;
constexpr double kReach = 0.8;       // of candidates from the thing, in its radii
constexpr double kTolerance = 0.06;  // of a plane, in radii of the thing
constexpr float kMinLogit = -0.85f;  // of a candidate: an opacity of 0.3
constexpr int kNumDraws = 512;
constexpr double kMinShare = 0.1;  // of the candidates, for a plane
constexpr size_t kMinMembers = 12;
// Cosine of the angle to another plane, with which it is the same rough surface.
constexpr double kSameDirection = 0.9;
constexpr double kMaxGap = 0.25;   // between a plane and the thing, in radii of the thing
constexpr double kMinAbove = 0.9;  // share of the thing on one side of a plane

struct PlaneCandidate {
  int64_t row;
  Eigen::Vector3d mean;
};

// Returns every n-th so that at most `most` are left.
template <class T>
std::vector<T> Thinned(const std::vector<T>& values, size_t most) {
  const size_t stride = (values.size() + most - 1) / most;
  if (stride <= 1) return values;
  std::vector<T> thinned;
  for (size_t i = 0; i < values.size(); i += stride) thinned.push_back(values[i]);
  return thinned;
}

std::vector<PlaneCandidate> CandidatesNear(const Gaussians& gaussians, const GaussianSet& rest,
                                           std::span<const Eigen::Vector3d> thing,
                                           const ThingSpace& space) {
  const NearestPoints nearest(thing);
  const double reach = kReach * space.radius;
  std::vector<PlaneCandidate> candidates;
  for (int64_t row = 0; row < gaussians.count; ++row) {
    if (rest.member[row] == 0 || gaussians.Plane(kOpacityPlane)[row] < kMinLogit) continue;
    const Eigen::Vector3d mean = MeanOf(gaussians, row);
    if ((mean - space.center).norm() > space.radius * (1.5 + kReach)) continue;
    if (nearest.Find(mean).distance <= reach) candidates.push_back({row, mean});
  }
  return Thinned(candidates, kMaxCandidates);
}

// Returns the plane that fits the points best, through their mean.
SupportPlane FitPlane(std::span<const Eigen::Vector3d> points) {
  SupportPlane plane;
  plane.point.setZero();
  for (const Eigen::Vector3d& p : points) plane.point += p;
  plane.point /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) {
    scatter += (p - plane.point) * (p - plane.point).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(scatter);
  plane.normal = axes.eigenvectors().col(0);  // of the smallest eigenvalue
  return plane;
}

std::vector<PlaneCandidate> Within(const SupportPlane& plane, double tolerance,
                                   std::span<const PlaneCandidate> candidates) {
  std::vector<PlaneCandidate> within;
  std::ranges::copy_if(candidates, std::back_inserter(within), [&](const PlaneCandidate& c) {
    return std::abs(plane.Above(c.mean)) <= tolerance;
  });
  return within;
}

std::vector<Eigen::Vector3d> CandidateMeans(std::span<const PlaneCandidate> candidates) {
  std::vector<Eigen::Vector3d> means;
  means.reserve(candidates.size());
  for (const PlaneCandidate& c : candidates) means.push_back(c.mean);
  return means;
}

// Returns the plane of three drawn candidates with the most candidates, fitted to these.
SupportPlane BestPlane(std::span<const PlaneCandidate> candidates, double tolerance,
                       std::mt19937_64& random) {
  SupportPlane best;
  size_t most = 0;
  for (int draw = 0; draw < kNumDraws; ++draw) {
    Eigen::Vector3d p[3];
    for (Eigen::Vector3d& corner : p) corner = candidates[random() % candidates.size()].mean;
    const Eigen::Vector3d across = (p[1] - p[0]).cross(p[2] - p[0]);
    if (!(across.norm() > 0)) continue;
    SupportPlane plane;
    plane.point = p[0], plane.normal = across.normalized();
    const size_t num = Within(plane, tolerance, candidates).size();
    if (num > most) most = num, best = plane;
  }
  for (int round = 0; round < 3 && most >= 3; ++round) {
    const std::vector<PlaneCandidate> within = Within(best, tolerance, candidates);
    if (within.size() < 3) break;
    best = FitPlane(CandidateMeans(within));
  }
  return best;
}

// Returns the geometric mean of the two largest standard deviations of a Gaussian.
double SizeOf(const Gaussians& gaussians, int64_t row) {
  double sum = 0, least = 0;
  for (int k = 0; k < 3; ++k) {
    const double log_scale = gaussians.Plane(kLogScalePlane + k)[row];
    sum += log_scale;
    least = k == 0 ? log_scale : std::min(least, log_scale);
  }
  return std::exp((sum - least) / 2);
}

// Turns the normal to the thing. Returns false if the thing is on both sides, or does not touch it.
bool TurnToThing(std::span<const Eigen::Vector3d> thing, double max_gap, SupportPlane& plane) {
  const auto above = [&](double sign) {
    return std::ranges::count_if(thing, [&](const Eigen::Vector3d& p) {
      return sign * plane.Above(p) > -2 * plane.tolerance;
    });
  };
  if (above(-1) > above(1)) plane.normal = -plane.normal;
  const auto gap = std::ranges::min(
      thing | std::views::transform([&](const Eigen::Vector3d& p) { return plane.Above(p); }));
  if (gap > max_gap) return false;
  return static_cast<double>(above(1)) >= kMinAbove * static_cast<double>(thing.size());
}

}  // namespace

std::vector<SupportPlane> FindSupportPlanes(const Gaussians& gaussians, const GaussianSet& rest,
                                            std::span<const int64_t> thing,
                                            const ThingSpace& space) {
  const std::vector<Eigen::Vector3d> points = Thinned(MeansOf(gaussians, thing), kMaxThingPoints);
  std::vector<PlaneCandidate> left = CandidatesNear(gaussians, rest, points, space);
  const size_t enough =
      std::max(kMinMembers, static_cast<size_t>(kMinShare * static_cast<double>(left.size())));
  std::mt19937_64 random(1);
  std::vector<SupportPlane> planes;
  for (size_t round = 0; round < 2 * kMaxPlanes && planes.size() < kMaxPlanes; ++round) {
    if (left.size() < enough) break;
    SupportPlane plane = BestPlane(left, kTolerance * space.radius, random);
    plane.tolerance = kTolerance * space.radius;
    const std::vector<PlaneCandidate> within = Within(plane, plane.tolerance, left);
    if (within.size() < enough) break;
    std::vector<double> sizes;
    for (const PlaneCandidate& c : within) sizes.push_back(SizeOf(gaussians, c.row));
    plane.spacing = NearestRank(sizes, 0.5);
    const bool is_new = std::ranges::none_of(planes, [&](const SupportPlane& other) {
      return std::abs(other.normal.dot(plane.normal)) > kSameDirection;
    });
    if (is_new && TurnToThing(points, kMaxGap * space.radius, plane)) {
      plane.point = space.center - plane.Above(space.center) * plane.normal;
      planes.push_back(plane);
    }
    std::erase_if(left, [&](const PlaneCandidate& c) {
      return std::abs(plane.Above(c.mean)) <= plane.tolerance;
    });
  }
  return planes;
}

}  // namespace pepeseg
