#include "core/sfm/model_agreement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

#include "core/base/status_macros.h"
#include "core/formats/colmap.h"
#include "core/sfm/two_view/relative_pose.h"

namespace pepeseg {
namespace {

constexpr double kMostDisagreeing = 0.1;  // of all matches
constexpr double kMostOfOne = 0.4;        // of the matches of one photograph
constexpr int kFewestOffPlane = 30;

struct Counts {
  int64_t agreeing = 0, disagreeing = 0;

  void Add(const Counts& other) {
    agreeing += other.agreeing;
    disagreeing += other.disagreeing;
  }
  bool Exceeds(double share) const {
    return static_cast<double>(disagreeing) > share * static_cast<double>(agreeing + disagreeing);
  }
};

struct RegisteredPhotograph {
  Pose cam_from_world;
  Lens lens;
};

// Returns the point on the plane z = 1 that a feature shows. SIMPLE_RADIAL distorts by less than
// the iteration needs to converge, or the model is bad anyway.
Eigen::Vector2d Undistorted(const Lens& lens, const Keypoint& keypoint) {
  const Eigen::Vector2d distorted = lens.PinholeRay({keypoint.x, keypoint.y});
  Eigen::Vector2d ray = distorted;
  for (int i = 0; i < 10; ++i) ray += distorted - lens.Distort(ray);
  return ray;
}

Counts CountMatches(const SfmFeatures& first, const SfmFeatures& second, const ComparedPair& pair,
                    const RegisteredPhotograph& a, const RegisteredPhotograph& b,
                    double max_error) {
  const Pose pose{b.cam_from_world.rotation * a.cam_from_world.rotation.conjugate(),
                  b.cam_from_world.translation -
                      b.cam_from_world.rotation *
                          (a.cam_from_world.rotation.conjugate() * a.cam_from_world.translation)};
  // The squared distances do not depend on the length of the translation.
  const Eigen::Matrix3d essential =
      EssentialMatrix({pose.rotation.toRotationMatrix(), pose.translation});
  const double threshold = max_error * 2 / (a.lens.fx + b.lens.fx);
  Counts counts;
  for (const FeatureMatch& match : pair.geometry.inliers) {
    const PointPair points{Undistorted(a.lens, first.keypoints[match.first]),
                           Undistorted(b.lens, second.keypoints[match.second])};
    // NaN does not agree.
    const bool agrees = SampsonSquared(essential, points) <= threshold * threshold;
    ++(agrees ? counts.agreeing : counts.disagreeing);
  }
  return counts;
}

// Returns the photographs of the database by index; nothing for those without a pose.
absl::StatusOr<std::vector<std::optional<RegisteredPhotograph>>> Registered(
    const DatabaseFeatures& features, const SfmModel& model) {
  ASSIGN_OR_RETURN(const auto images, ReadColmapImages(model.folder / "images.bin", "images.bin"));
  ASSIGN_OR_RETURN(const ColmapCameras cameras,
                   ReadColmapCameras(model.folder / "cameras.bin", "cameras.bin"));
  std::map<std::string, size_t> index;
  for (size_t i = 0; i < features.images.size(); ++i) index[features.images[i].name] = i;
  std::vector<std::optional<RegisteredPhotograph>> registered(features.images.size());
  for (const ColmapImage& image : images) {
    const auto found = index.find(image.name);
    const auto camera = cameras.by_id.find(image.camera_id);
    if (found == index.end() || camera == cameras.by_id.end()) continue;
    registered[found->second] = {image.cam_from_world, camera->second};
  }
  return registered;
}

}  // namespace

bool ModelAgreement::IsPlausible() const {
  return doubtful.empty() && !Counts{agreeing, disagreeing}.Exceeds(kMostDisagreeing);
}

absl::StatusOr<ModelAgreement> MeasureAgreement(const DatabaseFeatures& features,
                                                std::span<const ComparedPair> pairs,
                                                const SfmModel& model, double max_error) {
  ASSIGN_OR_RETURN(const auto registered, Registered(features, model));
  Counts all;
  std::vector<Counts> of(features.images.size());
  for (const ComparedPair& pair : pairs) {
    const auto &a = registered[pair.first], &b = registered[pair.second];
    if (!a || !b) continue;
    const Counts counts =
        CountMatches(features.images[pair.first].features, features.images[pair.second].features,
                     pair, *a, *b, max_error);
    all.Add(counts);
    of[pair.first].Add(counts);
    of[pair.second].Add(counts);
  }
  ModelAgreement agreement{all.agreeing, all.disagreeing, {}};
  for (size_t i = 0; i < of.size(); ++i) {
    if (of[i].Exceeds(kMostOfOne)) agreement.doubtful.push_back(features.images[i].name);
  }
  std::sort(agreement.doubtful.begin(), agreement.doubtful.end());
  return agreement;
}

std::vector<std::pair<int64_t, int64_t>> InitialPairs(const DatabaseFeatures& features,
                                                      std::span<const ComparedPair> pairs,
                                                      size_t count, double max_error) {
  std::vector<std::tuple<int, int64_t, int64_t>> ranked;  // by the negative number off the plane
  for (const ComparedPair& pair : pairs) {
    if (pair.geometry.kind != TwoViewKind::kCalibrated &&
        pair.geometry.kind != TwoViewKind::kUncalibrated) {
      continue;
    }
    const DatabaseImage &a = features.images[pair.first], &b = features.images[pair.second];
    int off_plane = 0;
    for (const FeatureMatch& match : pair.geometry.inliers) {
      const Keypoint &p = a.features.keypoints[match.first],
                     &q = b.features.keypoints[match.second];
      const Eigen::Vector2d moved =
          (pair.geometry.homography * Eigen::Vector3d(p.x, p.y, 1)).hnormalized();
      // NaN is off the plane.
      off_plane += !((moved - Eigen::Vector2d(q.x, q.y)).norm() <= max_error);
    }
    if (off_plane >= kFewestOffPlane) ranked.emplace_back(-off_plane, a.id, b.id);
  }
  std::sort(ranked.begin(), ranked.end());
  std::vector<std::pair<int64_t, int64_t>> best;
  for (const auto& [rank, first, second] : ranked) {
    if (best.size() < count) best.emplace_back(first, second);
  }
  return best;
}

}  // namespace pepeseg
