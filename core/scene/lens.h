#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The camera models of COLMAP, with the numbers that it gives them.
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

// Returns COLMAP's name of the model, such as "OPENCV".
absl::string_view NameOf(LensModel model);
// Returns the model of that name, or nothing if COLMAP has none.
std::optional<LensModel> LensModelByName(absl::string_view name);
// Returns how many parameters a camera of this model has in COLMAP's files: one or two focal
// lengths, two coordinates of the principal point, and the distortion coefficients.
int NumParameters(LensModel model);

// A camera with distortion. Sizes, focal lengths and the principal point are pixels; the centre of
// pixel (x, y) is at (x + 0.5, y + 0.5).
struct Lens {
  LensModel model = LensModel::kPinhole;
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, kMaxLensParameters - 4> distortion{};  // in COLMAP's order, then zeros

  // Returns true if the lens does not distort: a pinhole model, or one whose coefficients are all
  // 0. Fisheye models are never pinholes.
  bool IsPinhole() const;
  // Returns where the ray (x, y, 1) in camera coordinates meets the distorted image plane at focal
  // length 1.
  Eigen::Vector2d Distort(const Eigen::Vector2d& ray) const;
  // Returns the pixel that the ray (x, y, 1) is seen at.
  Eigen::Vector2d Project(const Eigen::Vector2d& ray) const;
  // Returns the ray (x, y, 1) through a pixel of the pinhole that has the same focal lengths and
  // principal point and no distortion.
  Eigen::Vector2d PinholeRay(const Eigen::Vector2d& pixel) const;

  bool operator==(const Lens&) const = default;
};

// Makes a lens of `parameters`: NumParameters(model) numbers in the order of COLMAP's files.
Lens MakeLens(LensModel model, int width, int height, const double* parameters);

// Returns INVALID_ARGUMENT if the width or height is outside of [1, 32766], a parameter is not
// finite, a focal length is not positive or exceeds 1000 times the larger side, or the principal
// point is further from the corner than that.
absl::Status Validate(const Lens& lens);

// Returns the lens of the same photograph, resized to width x height pixels.
Lens Resized(const Lens& lens, int width, int height);

}  // namespace pepeseg
