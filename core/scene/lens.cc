#include "core/scene/lens.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

// Name and numbers of parameters of a model. Two more parameters are the principal point.
struct ModelFacts {
  const char* name;
  int num_focals;
  int num_distortion;
};

// Indexed by LensModel. Names, parameters and formulas are those of COLMAP's camera models
// (https://colmap.github.io/cameras.html).
constexpr std::array<ModelFacts, kNumLensModels> kFacts = {{
    {"SIMPLE_PINHOLE", 1, 0},
    {"PINHOLE", 2, 0},
    {"SIMPLE_RADIAL", 1, 1},          // k
    {"RADIAL", 1, 2},                 // k1 k2
    {"OPENCV", 2, 4},                 // k1 k2 p1 p2
    {"OPENCV_FISHEYE", 2, 4},         // k1 k2 k3 k4
    {"FULL_OPENCV", 2, 8},            // k1 k2 p1 p2 k3 k4 k5 k6
    {"FOV", 2, 1},                    // omega
    {"SIMPLE_RADIAL_FISHEYE", 1, 1},  // k
    {"RADIAL_FISHEYE", 1, 2},         // k1 k2
    {"THIN_PRISM_FISHEYE", 2, 8},     // k1 k2 p1 p2 k3 k4 sx1 sy1
}};

const ModelFacts& FactsOf(LensModel model) { return kFacts[static_cast<size_t>(model)]; }

// Returns the decentring term of Brown's model (the tangential distortion of OpenCV).
Vector2d Tangential(const Vector2d& p, double p1, double p2) {
  const double r2 = p.squaredNorm();
  const double xy = p.x() * p.y();
  return {2 * p1 * xy + p2 * (r2 + 2 * p.x() * p.x()), 2 * p2 * xy + p1 * (r2 + 2 * p.y() * p.y())};
}

// Returns the ray's angle to the optical axis in radians, as the length of a vector in the ray's
// direction. Fisheye models distort this vector, pinhole models the ray (x, y) itself, whose length
// is the tangent of the angle.
Vector2d AngleOf(const Vector2d& ray) {
  const double slope = ray.norm();
  return slope < 1e-12 ? ray : Vector2d(ray * (std::atan(slope) / slope));
}

// Returns 1 + k1 q + k2 q^2 + ... at q = r2, the squared radius.
double RadialFactor(double r2, std::initializer_list<double> coefficients) {
  double factor = 1;
  double power = 1;
  for (const double k : coefficients) factor += k * (power *= r2);
  return factor;
}

// Applies the FOV model (Devernay and Faugeras, 2001): r_d = atan(2 r tan(omega / 2)) / omega. The
// small cases avoid 0 / 0 by the limits of the formula.
Vector2d FieldOfView(const Vector2d& ray, double omega) {
  const double slope = ray.norm();
  const double reach = 2 * std::tan(omega / 2);
  if (std::abs(omega) < 1e-9) return ray;
  if (slope * reach < 1e-9) return ray * (reach / omega);
  return ray * (std::atan(slope * reach) / (slope * omega));
}

}  // namespace

absl::string_view NameOf(LensModel model) { return FactsOf(model).name; }

std::optional<LensModel> LensModelByName(absl::string_view name) {
  for (int i = 0; i < kNumLensModels; ++i) {
    if (name == kFacts[i].name) return static_cast<LensModel>(i);
  }
  return std::nullopt;
}

int NumParameters(LensModel model) {
  return FactsOf(model).num_focals + 2 + FactsOf(model).num_distortion;
}

bool Lens::IsPinhole() const {
  switch (model) {
    case LensModel::kOpencvFisheye:
    case LensModel::kSimpleRadialFisheye:
    case LensModel::kRadialFisheye:
    case LensModel::kThinPrismFisheye:
      return false;  // equidistant even if all coefficients are 0
    default:
      return std::all_of(distortion.begin(), distortion.end(), [](double k) { return k == 0; });
  }
}

// Models with fewer coefficients have zeros in `distortion`, so they share the code of larger ones.
Vector2d Lens::Distort(const Vector2d& ray) const {
  const auto& k = distortion;
  const double r2 = ray.squaredNorm();
  switch (model) {
    case LensModel::kSimplePinhole:
    case LensModel::kPinhole:
      return ray;
    case LensModel::kSimpleRadial:
    case LensModel::kRadial:
      return ray * RadialFactor(r2, {k[0], k[1]});
    case LensModel::kOpencv:
      return ray * RadialFactor(r2, {k[0], k[1]}) + Tangential(ray, k[2], k[3]);
    case LensModel::kFullOpencv:
      return ray * (RadialFactor(r2, {k[0], k[1], k[4]}) / RadialFactor(r2, {k[5], k[6], k[7]})) +
             Tangential(ray, k[2], k[3]);
    case LensModel::kFov:
      return FieldOfView(ray, k[0]);
    case LensModel::kSimpleRadialFisheye:
    case LensModel::kRadialFisheye:
    case LensModel::kOpencvFisheye: {
      const Vector2d angle = AngleOf(ray);
      return angle * RadialFactor(angle.squaredNorm(), {k[0], k[1], k[2], k[3]});
    }
    case LensModel::kThinPrismFisheye: {
      const Vector2d angle = AngleOf(ray);
      const double a2 = angle.squaredNorm();
      return angle * RadialFactor(a2, {k[0], k[1], k[4], k[5]}) + Tangential(angle, k[2], k[3]) +
             Vector2d(k[6], k[7]) * a2;
    }
  }
  return ray;
}

Vector2d Lens::Project(const Vector2d& ray) const {
  const Vector2d p = Distort(ray);
  return {fx * p.x() + cx, fy * p.y() + cy};
}

Vector2d Lens::PinholeRay(const Vector2d& pixel) const {
  return {(pixel.x() - cx) / fx, (pixel.y() - cy) / fy};
}

// The order is focal lengths, principal point, distortion. With one focal length, num_focals - 1 is
// 0, so fy equals fx.
Lens MakeLens(LensModel model, int width, int height, const double* parameters) {
  const ModelFacts& facts = FactsOf(model);
  Lens lens{.model = model, .width = width, .height = height};
  lens.fx = parameters[0];
  lens.fy = parameters[facts.num_focals - 1];
  lens.cx = parameters[facts.num_focals];
  lens.cy = parameters[facts.num_focals + 1];
  std::copy_n(parameters + facts.num_focals + 2, facts.num_distortion, lens.distortion.begin());
  return lens;
}

absl::Status Validate(const Lens& lens) {
  constexpr int kMaxSide = 32766;  // the limit of OpenCV's remap()
  constexpr double kMaxFocalInSides = 1000;
  if (lens.width < 1 || lens.height < 1 || lens.width > kMaxSide || lens.height > kMaxSide) {
    return absl::InvalidArgumentError(
        absl::StrCat("the size ", lens.width, "x", lens.height, " is outside of 1 to ", kMaxSide));
  }
  const double most = kMaxFocalInSides * std::max(lens.width, lens.height);
  const bool finite = std::isfinite(lens.cx) && std::isfinite(lens.cy) &&
                      std::all_of(lens.distortion.begin(), lens.distortion.end(),
                                  [](double k) { return std::isfinite(k); });
  if (!finite) return absl::InvalidArgumentError("a parameter is not finite");
  // A focal length of 1000 times the image is a view of 0.06 degrees: not a camera, but a unit
  // error.
  if (!(lens.fx > 0 && lens.fx <= most && lens.fy > 0 && lens.fy <= most)) {
    return absl::InvalidArgumentError(absl::StrCat("the focal length ", lens.fx, ", ", lens.fy,
                                                   " is outside of 0 to ", most, " pixels"));
  }
  if (std::abs(lens.cx) > most || std::abs(lens.cy) > most) {
    return absl::InvalidArgumentError(absl::StrCat("the principal point ", lens.cx, ", ", lens.cy,
                                                   " is further than ", most, " pixels"));
  }
  return absl::OkStatus();
}

Lens Resized(const Lens& lens, int width, int height) {
  const double sx = static_cast<double>(width) / lens.width;
  const double sy = static_cast<double>(height) / lens.height;
  Lens resized = lens;
  resized.width = width;
  resized.height = height;
  resized.fx *= sx, resized.cx *= sx;
  resized.fy *= sy, resized.cy *= sy;
  return resized;
}

}  // namespace pepeseg
