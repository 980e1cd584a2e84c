#include <gtest/gtest.h>

#include <random>

#include "kernels/math/adam.h"
#include "kernels/math/blend.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"
#include "tests/kernels/central_differences.h"
#include "tests/kernels/test_scene.h"

// The Vjp functions of kernels/math against central differences, in double.

namespace pepeseg {
namespace {

using Values = std::vector<double>;
constexpr double kTolerance = 1e-6;

Values Random(int count, double low, double high, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(low, high);
  Values values(count);
  for (double& value : values) value = uniform(engine);
  return values;
}

// The scalar product, as the loss that gradients are taken of.
double Against(const Values& weights, const Values& values) {
  double sum = 0;
  for (size_t i = 0; i < values.size(); ++i) sum += weights[i] * values[i];
  return sum;
}

// A shape as ten numbers: mean, log scale, rotation.
GaussianShape<double> ShapeOf(const Values& x) {
  return {{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, {x[6], x[7], x[8], x[9]}};
}

Values Flat(const GaussianShape<double>& s) {
  return {s.mean.x,      s.mean.y,     s.mean.z,     s.log_scale.x, s.log_scale.y,
          s.log_scale.z, s.rotation.w, s.rotation.x, s.rotation.y,  s.rotation.z};
}

// All outputs of the projection that have a gradient.
Values Project(const Values& x) {
  const auto p = Project(MakeProjectionCamera<double>(TestView(64, 48)), ShapeOf(x));
  return {p.x, p.y, p.conic.xx, p.conic.xy, p.conic.yy, p.mean_in_cam.z};
}

// Compares the gradient of a random linear loss of the projection, separately for mean, scale and
// rotation, whose sizes differ.
void ExpectProjectVjp(const Values& x, uint64_t seed) {
  const Values w = Random(6, -1, 1, seed);
  const auto camera = MakeProjectionCamera<double>(TestView(64, 48));
  const Values got = Flat(ProjectVjp(camera, ShapeOf(x), {w[0], w[1], {w[2], w[3], w[4]}, w[5]}));
  const Values want =
      CentralDifferences([&](const Values& v) { return Against(w, Project(v)); }, x);
  const Values mean_got(got.begin(), got.begin() + 3), mean_want(want.begin(), want.begin() + 3);
  const Values scale_got(got.begin() + 3, got.begin() + 6);
  const Values scale_want(want.begin() + 3, want.begin() + 6);
  const Values turn_got(got.begin() + 6, got.end()), turn_want(want.begin() + 6, want.end());
  EXPECT_LT(RelativeError(mean_got, mean_want), kTolerance);
  EXPECT_LT(RelativeError(scale_got, scale_want), kTolerance);
  EXPECT_LT(RelativeError(turn_got, turn_want), kTolerance);
}

Values RandomShape(uint64_t seed) {
  Values x = Random(10, -1, 1, seed);
  for (int k = 3; k < 6; ++k) x[k] = 0.8 * x[k] - 2;
  return x;
}

TEST(ProjectVjp, MatchesCentralDifferences) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Values x = RandomShape(seed);
    for (int k = 0; k < 3; ++k) x[k] *= 0.5;  // inside the image
    ExpectProjectVjp(x, 100 + seed);
  }
}

TEST(ProjectVjp, MatchesCentralDifferencesWhereTheJacobianIsClamped) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Values x = RandomShape(seed);
    x[0] += seed % 2 ? 4 : -4;     // far beyond the left or right edge
    if (seed % 3 == 0) x[1] += 3;  // both clamped
    ExpectProjectVjp(x, 100 + seed);
  }
}

TEST(ProjectVjp, ClampsTheJacobianOutsideTheImage) {
  Values inside = RandomShape(1), outside = inside;
  outside[0] += 4;
  auto camera = MakeProjectionCamera<double>(TestView(64, 48));
  const auto clamped = pepeseg::Project(camera, ShapeOf(outside));
  camera.max_x = 1e6;
  const auto free = pepeseg::Project(camera, ShapeOf(outside));
  EXPECT_GT(std::abs(clamped.conic.xx - free.conic.xx), 1e-3 * std::abs(free.conic.xx));
}

TEST(RotationVjp, MatchesCentralDifferencesForAnyNorm) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Values q = Random(4, -1, 1, seed);
    // The rotation does not depend on the norm, but its gradient does.
    for (double& v : q) v *= 0.2 + 0.3 * static_cast<double>(seed);
    const Values w = Random(9, -1, 1, seed + 50);
    const auto f = [&](const Values& v) {
      const auto r = RotationFromQuaternion<double>({v[0], v[1], v[2], v[3]});
      return Against(w, {r.row0.x, r.row0.y, r.row0.z, r.row1.x, r.row1.y, r.row1.z, r.row2.x,
                         r.row2.y, r.row2.z});
    };
    const auto g = RotationFromQuaternionVjp<double>(
        {q[0], q[1], q[2], q[3]}, {{w[0], w[1], w[2]}, {w[3], w[4], w[5]}, {w[6], w[7], w[8]}});
    EXPECT_LT(RelativeError({g.w, g.x, g.y, g.z}, CentralDifferences(f, q, 1e-4)), kTolerance);
  }
}

TEST(NormalizeVjp, MatchesCentralDifferences) {
  const Values a = Random(3, -1, 1, 5), w = Random(3, -1, 1, 6);
  const auto f = [&](const Values& v) {
    const auto u = Normalize(Vec3<double>{v[0], v[1], v[2]});
    return Against(w, {u.x, u.y, u.z});
  };
  const auto g = NormalizeVjp(Vec3<double>{a[0], a[1], a[2]}, {w[0], w[1], w[2]});
  EXPECT_LT(RelativeError({g.x, g.y, g.z}, CentralDifferences(f, a)), kTolerance);
}

TEST(ShBasisVjp, MatchesCentralDifferencesAtEveryDegree) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      // ShBasis is a polynomial of any vector, so the vector need not have length 1 here.
      const Values x = Random(3, -1, 1, seed);
      const Values w = Random(16, -1, 1, seed + 10);
      const auto f = [&](const Values& v) {
        Values basis(16);
        ShBasis(Vec3<double>{v[0], v[1], v[2]}, degree, basis.data());
        return Against(w, basis);
      };
      const auto g = ShBasisVjp(Vec3<double>{x[0], x[1], x[2]}, degree, w.data());
      EXPECT_LT(RelativeError({g.x, g.y, g.z}, CentralDifferences(f, x)), kTolerance);
    }
  }
}

TEST(ShChannelVjp, IsMaskedWhereTheColourIsClamped) {
  for (const double x : {-2.0, -0.6, -0.4, 0.0, 1.0}) {
    const auto f = [&](const Values& v) { return 1.7 * ShChannel(v[0]); };
    EXPECT_NEAR(ShChannelVjp(x, 1.7), CentralDifferences(f, {x})[0], 1e-9);
  }
}

TEST(SigmoidVjp, MatchesCentralDifferences) {
  for (const double x : {-6.0, -1.0, 0.0, 3.0}) {
    const auto f = [](const Values& v) { return 0.7 * Sigmoid(v[0]); };
    const double want = CentralDifferences(f, {x})[0];
    EXPECT_NEAR(SigmoidVjp(Sigmoid(x), 0.7), want, kTolerance * std::abs(want));
  }
}

TEST(AdamStep, MatchesTheFormulaOfThePaper) {
  double m = 0, v = 0, moment1 = 0, moment2 = 0, x = 0.3, want = 0.3;
  const Values grads = Random(50, -1, 1, 3);
  for (int t = 1; t <= 50; ++t) {
    const double g = grads[t - 1];
    m = 0.9 * m + 0.1 * g;
    v = 0.999 * v + 0.001 * g * g;
    want -= 0.01 * (m / (1 - std::pow(0.9, t))) / (std::sqrt(v / (1 - std::pow(0.999, t))) + 1e-8);
    const AdamRates<double> rates = {0.9, 0.999, 1e-8, 1 / (1 - std::pow(0.9, t)),
                                     1 / std::sqrt(1 - std::pow(0.999, t))};
    x += AdamStep(rates, 0.01, g, moment1, moment2);
    EXPECT_NEAR(x, want, 1e-12);
  }
}

TEST(AdamStep, TakesAFirstStepOfTheLearningRate) {
  double moment1 = 0, moment2 = 0;
  const AdamRates<double> rates = {0.9, 0.999, 1e-15, 10, 1 / std::sqrt(0.001)};
  EXPECT_NEAR(AdamStep(rates, 0.01, -3e-5, moment1, moment2), 0.01, 1e-9);
}

}  // namespace
}  // namespace pepeseg
