#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// The cost of errors in poses, depth priors and masks: in PSNR of held-out views, and in IoU with
// one click per object. Only training data are perturbed, never what is scored.

namespace pepeseg::testing {
namespace {

int NumPerturbedSteps() { return FullStress() ? 3'000 : 500; }

struct Accuracy {
  double psnr = 0, iou = 0;
};

class Perturbations : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (backend_ == nullptr) return;
    clean_ = TinyScene({.num_views = 12,
                        .side = 48,
                        .held_out_every = 4,
                        .num_points = 500,
                        .depth = DepthPrior::Kind::kDisparity});
    truth_ = Learn("none", [](View&) {});
  }

  template <class Fn>
  Accuracy Learn(const char* what, Fn&& perturb) {
    SyntheticScene scene = clean_;
    for (View& view : scene.capture.views) {
      if (!view.held_out) perturb(view);
    }
    ReconstructOptions options = TinyReconstruct(NumPerturbedSteps());
    options.max_gaussians = 900;
    Accuracy accuracy;
    const auto one = RunStageOne(*backend_, scene.capture, options);
    EXPECT_OK(one.status());
    if (!one.ok()) return accuracy;
    accuracy.psnr = one->psnr;
    FeatureOptions features = TinyFeatures(NumPerturbedSteps());
    features.num_pixels = 128;
    const auto two = RunStageTwo(*backend_, scene.capture, one->gaussians, features);
    EXPECT_OK(two.status());
    if (!two.ok()) return accuracy;
    const auto iou = ClickIou(*backend_, clean_, one->gaussians, two->field);
    EXPECT_OK(iou.status());
    accuracy.iou = iou.value_or(0);
    ExpectAsMeasured(*backend_, std::string("perturbed, ") + what + ": PSNR", accuracy.psnr);
    ExpectAsMeasured(*backend_, std::string("perturbed, ") + what + ": IoU", accuracy.iou);
    return accuracy;
  }

  // A rotation around the camera's centre, and a translation.
  Accuracy LearnFromPoses(double degrees, double moved) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    const auto vector = [&] {
      return Eigen::Vector3d(normal(random), normal(random), normal(random));
    };
    const double radius = SceneRadius(clean_.capture);
    char what[64];
    std::snprintf(what, sizeof what, "poses %g degrees, %g of the radius", degrees, moved);
    return Learn(what, [&](View& view) {
      const Eigen::Vector3d axis = vector().normalized();
      const double angle = degrees * M_PI / 180 * normal(random);
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, axis));
      Pose& pose = view.cam_from_world;
      pose = {turn * pose.rotation, turn * pose.translation + moved * radius * vector()};
    });
  }

  Accuracy LearnFromPriors(float noise) {
    std::mt19937_64 random(1);
    std::normal_distribution<float> normal;
    char what[64];
    std::snprintf(what, sizeof what, "priors, noise of %g of their span", noise);
    return Learn(what, [&](View& view) {
      for (float& value : view.depth.values) value += noise * normal(random);
    });
  }

  // All masks of a view are shifted together, as if the view had been cropped differently.
  Accuracy LearnFromMovedMasks(int pixels) {
    char what[64];
    std::snprintf(what, sizeof what, "masks %d px to the right", pixels);
    return Learn(what, [&](View& view) {
      std::vector<BinaryMask> masks;
      const int width = view.camera.width, height = view.camera.height;
      for (int k = 0; k < view.masks.num_masks; ++k) {
        BinaryMask mask = view.masks.Extract(k);
        for (int y = 0; y < height; ++y) {
          uint8_t* row = mask.pixels.data() + size_t(y) * width;
          std::rotate(row, row + width - pixels, row + width);
        }
        masks.push_back(mask);
      }
      view.masks = BuildMaskSet(width, height, masks);
    });
  }

  Accuracy LearnFromMissingMasks(double share) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    char what[64];
    std::snprintf(what, sizeof what, "masks, %g of them missing", share);
    return Learn(what, [&](View& view) {
      std::vector<BinaryMask> masks;
      for (int k = 0; k < view.masks.num_masks; ++k) {
        if (uniform(random) >= share) masks.push_back(view.masks.Extract(k));
      }
      view.masks = BuildMaskSet(view.camera.width, view.camera.height, masks);
    });
  }

  Accuracy LearnFromSpeckledMasks(double share) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    char what[64];
    std::snprintf(what, sizeof what, "masks, %g of their pixels flipped", share);
    return Learn(what, [&](View& view) {
      std::vector<BinaryMask> masks;
      for (int k = 0; k < view.masks.num_masks; ++k) {
        masks.push_back(view.masks.Extract(k));
        for (uint8_t& pixel : masks.back().pixels) pixel ^= uniform(random) < share ? 1 : 0;
      }
      view.masks = BuildMaskSet(view.camera.width, view.camera.height, masks);
    });
  }

  SyntheticScene clean_;
  Accuracy truth_;
};
INSTANTIATE_TEST_SUITE_P(Backends, Perturbations, CpuAndCuda(), BackendName);

// Here a pixel is 0.02 radians, and a degree is 0.9 pixels.
TEST_P(Perturbations, OfPosesCostQualityByTheirSize) {
  const Accuracy small = LearnFromPoses(0.1, 0.001);
  if (FullStress()) LearnFromPoses(0.3, 0.003);
  if (FullStress()) LearnFromPoses(1, 0.01);
  const Accuracy large = LearnFromPoses(3, 0.03);
  EXPECT_LT(large.psnr, small.psnr);
  EXPECT_LT(large.psnr, truth_.psnr - 1);
}

TEST_P(Perturbations, OfPriorsCostLittle) {
  EXPECT_GT(LearnFromPriors(0.05f).psnr, truth_.psnr - 0.5);
  if (FullStress()) LearnFromPriors(0.2f);
  EXPECT_GT(LearnFromPriors(1).psnr, truth_.psnr - 1);
}

TEST_P(Perturbations, OfMasksDoNotChangeColour) {
  EXPECT_GT(LearnFromMovedMasks(1).psnr, truth_.psnr - 0.7);
  if (FullStress()) LearnFromMovedMasks(2);
  if (FullStress()) LearnFromMovedMasks(4);
  if (FullStress()) LearnFromMissingMasks(0.25);
  EXPECT_GT(LearnFromMissingMasks(0.5).psnr, truth_.psnr - 0.7);
  if (FullStress()) LearnFromMissingMasks(0.75);
  if (FullStress()) LearnFromSpeckledMasks(0.02);
  LearnFromSpeckledMasks(0.1);
}

}  // namespace
}  // namespace pepeseg::testing
