#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/sfm/features/features.h"
#include "core/sfm/two_view/two_view_geometry.h"

namespace pepeseg {

// A photograph to map. Photographs of one camera group have the same size and share their lens.
struct MapperPhotograph {
  std::string name;
  int width = 0, height = 0;  // pixels
  int camera_group = 0;       // from 0
  double focal = 0;           // from EXIF, pixels; 0: not known
  std::span<const Keypoint> keypoints;
};

// Two photographs and what EstimateTwoViewGeometry says of them.
struct VerifiedPair {
  uint32_t first = 0, second = 0;
  TwoViewGeometry geometry;
};

// COLMAP's SIMPLE_RADIAL: x = f (1 + k r^2) u + c, with u on the plane z = 1, r = |u|.
struct GroupLens {
  int width = 0, height = 0;
  double focal = 0;  // pixels
  double k1 = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // of the principal point off the centre, pixels

  Eigen::Vector2d Centre() const { return Eigen::Vector2d(width / 2.0, height / 2.0) + shift; }
  // Returns the image of a point in camera coordinates with z > 0.
  Eigen::Vector2d Project(const Eigen::Vector3d& point) const {
    const Eigen::Vector2d u = point.head<2>() / point.z();
    return focal * (1 + k1 * u.squaredNorm()) * u + Centre();
  }
  // Returns the point on the plane z = 1 that a pixel shows.
  Eigen::Vector2d Normalised(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d distorted = (pixel - Centre()) / focal;
    Eigen::Vector2d u = distorted;
    // Converges for the distortions that the gates let pass, |k1| r^2 < 1/3.
    for (int i = 0; i < 10 && k1 != 0; ++i) u = distorted / (1 + k1 * u.squaredNorm());
    return u;
  }
};

// The pose of a photograph: x_cam = rotation x_world + translation.
struct CameraPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  bool is_registered = false;

  Eigen::Vector3d Centre() const { return -rotation.transpose() * translation; }
  Eigen::Vector3d ToCamera(const Eigen::Vector3d& point) const {
    return rotation * point + translation;
  }
};

// A feature that shows a point.
struct Observation {
  uint32_t photograph = 0, feature = 0;

  auto operator<=>(const Observation&) const = default;
};

struct MappedPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<Observation> track;  // at most one of each photograph
};

// Lenses, poses and points of photographs.
struct GlobalModel {
  std::vector<GroupLens> lenses;  // by camera group
  std::vector<CameraPose> poses;  // by photograph
  std::vector<MappedPoint> points;
};

// Returns the position of a feature.
inline Eigen::Vector2d PixelOf(std::span<const MapperPhotograph> photographs,
                               const Observation& observation) {
  const Keypoint& k = photographs[observation.photograph].keypoints[observation.feature];
  return {k.x, k.y};
}

// Returns the distance in pixels between a feature and the image of a point, or infinity if the
// point is behind the camera.
double ReprojectionError(std::span<const MapperPhotograph> photographs, const GlobalModel& model,
                         const Eigen::Vector3d& point, const Observation& observation);

}  // namespace pepeseg
