#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The camera models that COLMAP writes, with its numbers.
enum class LensModel {
  kSimplePinhole = 0,
  kPinhole = 1,
  kSimpleRadial = 2,
  kRadial = 3,
  kOpencv = 4,
  kOpencvFisheye = 5,
  kFullOpencv = 6,
  kFov = 7,
  kSimpleRadialFisheye = 8,
  kRadialFisheye = 9,
  kThinPrismFisheye = 10,
};
inline constexpr int kNumLensModels = 11;
inline constexpr int kMaxLensParameters = 12;

absl::string_view NameOf(LensModel model);
std::optional<LensModel> LensModelByName(absl::string_view name);
// Of COLMAP's files: focal lengths (one or two), principal point, distortion.
int NumParameters(LensModel model);

// A camera with its distortion. Pixels, with pixel centres at integer + 0.5.
struct Lens {
  LensModel model = LensModel::kPinhole;
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, kMaxLensParameters - 4> distortion{};  // in COLMAP's order; the rest is 0

  // Whether it is a pinhole: by its model, or because nothing distorts.
  bool IsPinhole() const;
  // Where a ray (x, y, 1) in camera coordinates meets the distorted image plane at focal length 1.
  Eigen::Vector2d Distort(const Eigen::Vector2d& ray) const;
  // The same in pixels.
  Eigen::Vector2d Project(const Eigen::Vector2d& ray) const;
  // The ray through a pixel of a pinhole with these focal lengths and this principal point.
  Eigen::Vector2d PinholeRay(const Eigen::Vector2d& pixel) const;

  bool operator==(const Lens&) const = default;
};

// `parameters`: NumParameters(model) numbers as in COLMAP's files.
Lens MakeLens(LensModel model, int width, int height, const double* parameters);

// INVALID_ARGUMENT: a size outside of [1, 32766], a number that is not finite, a focal length that
// is not positive or so far from the image's size that it cannot be one.
absl::Status Validate(const Lens& lens);

// The lens of the same photograph at another size.
Lens Resized(const Lens& lens, int width, int height);

}  // namespace pepeseg
