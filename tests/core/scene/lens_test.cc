#include "core/scene/lens.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

struct Case {
  LensModel model;
  std::vector<double> parameters;
  Vector2d expected;  // pixel of the ray (0.3, -0.2, 1), by the formulas in Cases()
};

double Angle() { return std::atan(std::hypot(0.3, 0.2)); }

// Returns one case for each model. r^2 is 0.13; fisheye models use theta = atan(sqrt(0.13)). The
// formulas are written out term by term and share no code with lens.cc.
std::vector<Case> Cases() {
  const double r = std::sqrt(0.13), t = Angle(), t2 = t * t;
  const double ax = 0.3 * t / r, ay = -0.2 * t / r;  // angle vector
  const double fish = t / r * (1 + 0.05 * t2);
  const double fish2 = t / r * (1 + 0.05 * t2 - 0.01 * t2 * t2);
  const double fish4 = fish2 + t / r * (0.003 * std::pow(t, 6) - 0.001 * std::pow(t, 8));
  const double brown = 1 + 0.1 * 0.13 - 0.02 * 0.0169;
  const double tx = 2 * 0.001 * -0.06 + -0.002 * (0.13 + 2 * 0.09);
  const double ty = 2 * -0.002 * -0.06 + 0.001 * (0.13 + 2 * 0.04);
  const double ratio =
      (brown + 0.01 * 0.002197) / (1 + 0.02 * 0.13 + 0.03 * 0.0169 - 0.01 * 0.002197);
  const double reach = 2 * std::tan(0.45);
  const double fov = std::atan(r * reach) / (r * 0.9);
  const double thin =
      1 + 0.05 * t2 - 0.01 * t2 * t2 + 0.003 * std::pow(t, 6) - 0.001 * std::pow(t, 8);
  const double thin_x = ax * thin + 2 * 0.001 * ax * ay - 0.002 * (t2 + 2 * ax * ax) + 0.004 * t2;
  const double thin_y = ay * thin + 2 * -0.002 * ax * ay + 0.001 * (t2 + 2 * ay * ay) - 0.005 * t2;
  return {
      {LensModel::kSimplePinhole, {500, 320, 240}, {470, 140}},
      {LensModel::kPinhole, {500, 510, 320, 240}, {470, 138}},
      {LensModel::kSimpleRadial, {500, 320, 240, 0.1}, {320 + 150 * 1.013, 240 - 100 * 1.013}},
      {LensModel::kRadial, {500, 320, 240, 0.1, -0.02}, {320 + 150 * brown, 240 - 100 * brown}},
      {LensModel::kOpencv,
       {500, 510, 320, 240, 0.1, -0.02, 0.001, -0.002},
       {320 + 500 * (0.3 * brown + tx), 240 + 510 * (-0.2 * brown + ty)}},
      {LensModel::kOpencvFisheye,
       {500, 510, 320, 240, 0.05, -0.01, 0.003, -0.001},
       {320 + 150 * fish4, 240 - 102 * fish4}},
      {LensModel::kFullOpencv,
       {500, 510, 320, 240, 0.1, -0.02, 0.001, -0.002, 0.01, 0.02, 0.03, -0.01},
       {320 + 500 * (0.3 * ratio + tx), 240 + 510 * (-0.2 * ratio + ty)}},
      {LensModel::kFov, {500, 510, 320, 240, 0.9}, {320 + 150 * fov, 240 - 102 * fov}},
      {LensModel::kSimpleRadialFisheye,
       {500, 320, 240, 0.05},
       {320 + 150 * fish, 240 - 100 * fish}},
      {LensModel::kRadialFisheye,
       {500, 320, 240, 0.05, -0.01},
       {320 + 150 * fish2, 240 - 100 * fish2}},
      {LensModel::kThinPrismFisheye,
       {500, 510, 320, 240, 0.05, -0.01, 0.001, -0.002, 0.003, -0.001, 0.004, -0.005},
       {320 + 500 * thin_x, 240 + 510 * thin_y}},
  };
}

// Inverts Distort by Newton's method, with a Jacobian from finite differences.
Vector2d Undistort(const Lens& lens, const Vector2d& target) {
  Vector2d ray = target;
  for (int i = 0; i < 50; ++i) {
    constexpr double kStep = 1e-6;
    const Vector2d error = lens.Distort(ray) - target;
    Eigen::Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Vector2d step = Vector2d::Unit(k) * kStep;
      jacobian.col(k) = (lens.Distort(ray + step) - lens.Distort(ray - step)) / (2 * kStep);
    }
    ray -= jacobian.inverse() * error;
  }
  return ray;
}

TEST(Lens, ProjectsByTheFormulaOfEachColmapModel) {
  ASSERT_EQ(Cases().size(), static_cast<size_t>(kNumLensModels));
  for (const Case& c : Cases()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    ASSERT_EQ(static_cast<int>(c.parameters.size()), NumParameters(c.model));
    const Lens lens = MakeLens(c.model, 640, 480, c.parameters.data());
    const Vector2d pixel = lens.Project({0.3, -0.2});
    EXPECT_NEAR(pixel.x(), c.expected.x(), 1e-9);
    EXPECT_NEAR(pixel.y(), c.expected.y(), 1e-9);
    EXPECT_EQ(LensModelByName(NameOf(c.model)), c.model);
  }
}

TEST(Lens, HasAnInvertibleDistortionInEveryModel) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = MakeLens(c.model, 640, 480, c.parameters.data());
    for (double x = -0.6; x < 0.61; x += 0.15) {
      for (double y = -0.45; y < 0.46; y += 0.15) {
        EXPECT_LT((Undistort(lens, lens.Distort({x, y})) - Vector2d(x, y)).norm(), 1e-9);
      }
    }
  }
}

TEST(Lens, IsAPinholeOnlyWithoutDistortion) {
  for (const Case& c : Cases()) {
    SCOPED_TRACE(std::string(NameOf(c.model)));
    const Lens lens = MakeLens(c.model, 640, 480, c.parameters.data());
    const bool pinhole = c.model == LensModel::kSimplePinhole || c.model == LensModel::kPinhole;
    EXPECT_EQ(lens.IsPinhole(), pinhole);
    EXPECT_TRUE(!pinhole || lens.Distort({0.3, -0.2}) == Vector2d(0.3, -0.2));
    Lens without = lens;
    without.distortion = {};
    const Vector2d kept = without.Distort({0.3, -0.2}) - Vector2d(0.3, -0.2);
    EXPECT_EQ(without.IsPinhole(), kept.norm() < 1e-12);
  }
}

TEST(Lens, KeepsRaysAtRelativePositionsWhenResized) {
  const Lens lens = MakeLens(LensModel::kOpencv, 640, 480, Cases()[4].parameters.data());
  const Lens half = Resized(lens, 320, 240);
  EXPECT_LT((half.Project({0.3, -0.2}) * 2 - lens.Project({0.3, -0.2})).norm(), 1e-9);
}

TEST(Lens, RejectsInvalidSizesAndParameters) {
  Lens lens = MakeLens(LensModel::kOpencv, 640, 480, Cases()[4].parameters.data());
  EXPECT_OK(Validate(lens));
  lens.fy = 0;
  EXPECT_STATUS(Validate(lens), absl::StatusCode::kInvalidArgument, "focal length");
  lens.fy = 1e9;
  EXPECT_STATUS(Validate(lens), absl::StatusCode::kInvalidArgument, "focal length");
  lens.fy = 500;
  lens.distortion[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_STATUS(Validate(lens), absl::StatusCode::kInvalidArgument, "not finite");
  lens.distortion[3] = 0;
  lens.width = 1 << 20;
  EXPECT_STATUS(Validate(lens), absl::StatusCode::kInvalidArgument, "1048576x480");
}

}  // namespace
}  // namespace pepeseg
