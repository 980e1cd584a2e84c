#include "core/edit/edited_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/render/renderer.h"
#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

constexpr int64_t kCount = 60;

// Random Gaussians of SH degree 3 around the origin, with a feature each.
Model RandomModel() {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<float> uniform(-1, 1);
  Model model;
  model.gaussians = Gaussians::Zero(kCount, 3);
  for (int64_t i = 0; i < kCount; ++i) {
    const auto at = [&](int plane) -> float& { return model.gaussians.Plane(plane)[i]; };
    for (int k = 0; k < 3; ++k) {
      at(kMeanPlane + k) = 0.5f * uniform(random);
      at(kLogScalePlane + k) = -2.5f + 0.7f * uniform(random);
    }
    for (int k = 0; k < 4; ++k) at(kRotationPlane + k) = uniform(random);
    at(kOpacityPlane) = 1 + uniform(random);
    for (int k = kShPlane; k < NumPlanes(3); ++k) at(k) = 0.4f * uniform(random);
    for (int k = 0; k < kFeatureSize; ++k) model.field.features.push_back(uniform(random));
    model.field.confidence.push_back(0.5f + 0.4f * uniform(random));
  }
  model.scene_radius = 3;
  return model;
}

// All but the last 20.
GaussianSet First() {
  GaussianSet set{std::vector<uint8_t>(kCount, 1)};
  std::fill(set.member.end() - 20, set.member.end(), uint8_t{0});
  return set;
}

std::vector<float> FeatureOf(const FeatureField& field, int64_t row) {
  return {field.features.begin() + row * kFeatureSize,
          field.features.begin() + (row + 1) * kFeatureSize};
}

ModelView ViewFrom(const Pose& cam_from_world) {
  ModelView view;
  view.camera = {.width = 96, .height = 80, .fx = 90, .fy = 90, .cx = 48, .cy = 40};
  view.cam_from_world = cam_from_world;
  return view;
}

TEST(EditedModel, MovedGaussiansLookTheSameToAMovedCamera) {
  const Model model = RandomModel();
  const GaussianSet all{std::vector<uint8_t>(kCount, 1)};
  Similarity move;
  move.rotation = Eigen::Quaterniond(0.7, -0.2, 0.5, 0.4).normalized();
  move.scale = 1.7;
  move.translation = {0.3, -2, 1};
  move.pivot = {0.1, 0.2, -0.1};
  const EditedModel moved = MoveMembers(model, all, move, false);
  EXPECT_EQ(moved.num_changed, kCount);
  EXPECT_EQ(moved.touched.member, all.member);
  EXPECT_EQ(moved.field.features, model.field.features);
  // The camera that sees the moved scene as `before` sees the scene: distances are `scale` larger.
  Pose before, after;
  before.translation = {0.1, 0, 3};
  after.rotation = before.rotation * move.rotation.conjugate();
  after.translation = move.scale * before.translation -
                      after.rotation * (move.pivot + move.translation) +
                      move.scale * (before.rotation * move.pivot);
  CpuBackend backend{2};
  Renderer first(backend, model.gaussians, 3), second(backend, moved.gaussians, 3 * move.scale);
  const std::vector<float> seen = first.HostColorPlanes(ViewFrom(before));
  const std::vector<float> seen_after = second.HostColorPlanes(ViewFrom(after));
  double sum = 0, error = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    sum += seen[i] * seen[i];
    error += (seen[i] - seen_after[i]) * (seen[i] - seen_after[i]);
  }
  EXPECT_GT(sum, 100);
  // The blur of a pixel is not scaled, and a Gaussian ends at a whole pixel.
  EXPECT_LT(error, 1e-3 * sum);
}

TEST(EditedModel, ACopyStandsNextToTheOriginal) {
  const Model model = RandomModel();
  Similarity move;
  move.translation = {0, 0, 2};
  const EditedModel edited = MoveMembers(model, First(), move, true);
  ASSERT_EQ(edited.gaussians.count, kCount + 40);
  EXPECT_EQ(edited.num_added, 40);
  EXPECT_EQ(edited.num_changed + edited.num_removed, 0);
  EXPECT_EQ(edited.touched.count(), 40);
  for (int64_t i = 0; i < 40; ++i) {
    EXPECT_EQ(edited.touched.member[kCount + i], 1);
    EXPECT_EQ(FeatureOf(edited.field, kCount + i), FeatureOf(model.field, i));
    EXPECT_EQ(edited.field.confidence[kCount + i], model.field.confidence[i]);
    for (int k = 0; k < NumPlanes(3); ++k) {
      const float before = model.gaussians.Plane(k)[i];
      EXPECT_EQ(edited.gaussians.Plane(k)[i], before);
      EXPECT_EQ(edited.gaussians.Plane(k)[kCount + i], k == kMeanPlane + 2 ? before + 2 : before);
    }
  }
}

TEST(EditedModel, KnowsHowFarItsGaussiansReach) {
  Model model = RandomModel();
  GaussianSet two{std::vector<uint8_t>(kCount)};
  two.member[3] = two.member[7] = 1;
  EXPECT_LT(ReachOf(model.gaussians, two), 1);
  model.gaussians.Plane(kMeanPlane + 1)[7] = -40;
  EXPECT_EQ(ReachOf(model.gaussians, two), 40);
  model.gaussians.Plane(kLogScalePlane + 2)[3] = std::log(50.0f);
  EXPECT_NEAR(ReachOf(model.gaussians, two), 50, 1e-4);
  for (const float damaged : {NAN, -NAN, INFINITY, -INFINITY}) {
    model.gaussians.Plane(kMeanPlane)[3] = damaged;
    EXPECT_EQ(ReachOf(model.gaussians, two), INFINITY);
  }
  model.gaussians.Plane(kMeanPlane)[3] = 0;
  model.gaussians.Plane(kLogScalePlane)[3] = 1000;
  EXPECT_EQ(ReachOf(model.gaussians, two), INFINITY);
  two.member[3] = 0;
  EXPECT_EQ(ReachOf(model.gaussians, two), 40);
}

TEST(EditedModel, RemovesAndAdds) {
  const Model model = RandomModel();
  NewGaussians added = {model.gaussians.Select(std::vector<int64_t>{7, 7, 8}), {50, 51, 52}};
  const EditedModel edited = RemoveGaussians(model, First(), added);
  ASSERT_EQ(edited.gaussians.count, 23);
  EXPECT_EQ(edited.num_removed, 40);
  EXPECT_EQ(edited.num_added, 3);
  EXPECT_EQ(edited.touched.count(), 3);
  EXPECT_EQ(edited.gaussians.Plane(kMeanPlane)[0], model.gaussians.Plane(kMeanPlane)[40]);
  EXPECT_EQ(edited.gaussians.Plane(kMeanPlane)[22], model.gaussians.Plane(kMeanPlane)[8]);
  EXPECT_EQ(FeatureOf(edited.field, 0), FeatureOf(model.field, 40));
  EXPECT_EQ(FeatureOf(edited.field, 21), FeatureOf(model.field, 51));
}

TEST(EditedModel, RecoloursWithItsShades) {
  const Model model = RandomModel();
  const Eigen::Vector3d red(0.6, 0.2, 0.1);
  const EditedModel edited = RecolorMembers(model, First(), {red, 1});
  const auto color = [](const Gaussians& gaussians, int64_t i) {
    const auto at = [&](int k) { return 0.5 + kSh0 * gaussians.Plane(kShPlane + k)[i]; };
    return Eigen::Vector3d(at(0), at(1), at(2));
  };
  const Eigen::Vector3d luminance(0.2126, 0.7152, 0.0722);
  const double first = luminance.dot(color(model.gaussians, 0));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0;
  for (int64_t i = 0; i < 40; ++i) {
    const Eigen::Vector3d now = color(edited.gaussians, i);
    // The hue is the new one, and the shades are those of before.
    EXPECT_NEAR(now.y() / now.x(), 1.0 / 3, 1e-4);
    EXPECT_NEAR(now.x() / color(edited.gaussians, 0).x(),
                luminance.dot(color(model.gaussians, i)) / first, 1e-4);
    const double opacity = 1 / (1 + std::exp(-model.gaussians.Plane(kOpacityPlane)[i]));
    sum += opacity * now;
    weights += opacity;
  }
  EXPECT_LT((sum / weights - red).norm(), 1e-4);
  for (int64_t i = 40; i < kCount; ++i) {
    EXPECT_EQ(color(edited.gaussians, i), color(model.gaussians, i));
  }
  // Half of it is half way.
  const EditedModel half = RecolorMembers(model, First(), {red, 0.5});
  const Eigen::Vector3d between = (color(model.gaussians, 3) + color(edited.gaussians, 3)) / 2;
  EXPECT_LT((color(half.gaussians, 3) - between).norm(), 1e-5);
}

// All of it is black but a highlight, or none is.
TEST(EditedModel, RecoloursWhatIsBlack) {
  const Eigen::Vector3d red(0.6, 0.2, 0.1);
  const auto set = [](Gaussians& gaussians, int64_t i, double grey) {
    for (int k = 0; k < 3; ++k) {
      gaussians.Plane(kShPlane + k)[i] = static_cast<float>((grey - 0.5) / kSh0);
    }
  };
  const auto color = [](const Gaussians& gaussians, int64_t i) {
    const auto at = [&](int k) { return 0.5 + kSh0 * gaussians.Plane(kShPlane + k)[i]; };
    return Eigen::Vector3d(at(0), at(1), at(2));
  };
  Model model = RandomModel();
  for (int64_t i = 0; i < kCount; ++i) set(model.gaussians, i, 0);
  const EditedModel black = RecolorMembers(model, First(), {red, 1});
  EXPECT_LT((color(black.gaussians, 5) - red).norm(), 1e-4);
  const EditedModel half = RecolorMembers(model, First(), {red, 0.5});
  EXPECT_LT((color(half.gaussians, 5) - red / 2).norm(), 1e-4);
  set(model.gaussians, 5, 0.1);
  const EditedModel shade = RecolorMembers(model, First(), {red, 1});
  EXPECT_GT(color(shade.gaussians, 5).x(), 2 * color(shade.gaussians, 6).x());
  EXPECT_NEAR(color(shade.gaussians, 6).x(), red.x(), 0.05);
}

}  // namespace
}  // namespace pepeseg
