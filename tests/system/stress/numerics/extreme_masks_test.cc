#include <algorithm>
#include <cstdio>
#include <random>
#include <string>

#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// No mask, one, or a thousand per view; duplicates; masks that cover everything.

namespace pepeseg::testing {
namespace {

int NumMaskSteps() { return FullStress() ? 5'000 : 300; }

class ExtremeMasks : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (backend_ == nullptr) return;
    capture_ = TinyCapture({.depth = DepthPrior::Kind::kDisparity});
    const auto run = RunStageOne(*MakeCpu(), capture_, TinyReconstruct(300));
    ASSERT_OK(run.status());
    gaussians_ = run->gaussians;
  }

  template <class Fn>
  Capture WithMasks(Fn&& masks_of) const {
    Capture capture = capture_;
    for (View& view : capture.views) {
      const int width = view.camera.width, height = view.camera.height;
      const std::vector<BinaryMask> masks = masks_of(view);
      view.masks = BuildMaskSet(width, height, masks);
    }
    return capture;
  }

  // Runs stage one with refinement, and stage two.
  void Learn(const char* what, const Capture& capture) {
    ReconstructOptions options = TinyReconstruct(NumMaskSteps());
    options.refine_length = 0.2;
    const auto one = RunStageOne(*backend_, capture, options);
    EXPECT_OK(one.status()) << what;
    const auto two = RunStageTwo(*backend_, capture, gaussians_, TinyFeatures(NumMaskSteps()));
    ASSERT_OK(two.status()) << what;
    ExpectAsMeasured(*backend_, std::string("masks, ") + what, MedianOfLast(two->losses, 0.05));
    if (one.ok()) ExpectAsMeasured(*backend_, std::string("masks, ") + what + ": PSNR", one->psnr);
  }

  Capture capture_;
  Gaussians gaussians_;
};
INSTANTIATE_TEST_SUITE_P(Backends, ExtremeMasks, CpuAndCuda(), BackendName);

size_t NumPixels(const View& view) { return size_t(view.camera.width) * view.camera.height; }
BinaryMask Everything(const View& view) { return {std::vector<uint8_t>(NumPixels(view), 1)}; }

TEST_P(ExtremeMasks, AbsenceFailsStageTwoWithAReason) {
  const Capture capture = WithMasks([](const View&) { return std::vector<BinaryMask>(); });
  ReconstructOptions options = TinyReconstruct(NumMaskSteps());
  EXPECT_OK(RunStageOne(*backend_, capture, options).status());
  EXPECT_STATUS(RunStageTwo(*backend_, capture, gaussians_, TinyFeatures(NumMaskSteps())),
                absl::StatusCode::kFailedPrecondition, "mask");
}

TEST_P(ExtremeMasks, OfOneViewSuffice) {
  int view_number = 0;
  Learn("in one view", WithMasks([&](const View& view) {
          std::vector<BinaryMask> masks;
          if (view_number++ == 1) masks.push_back(view.masks.Extract(0));
          return masks;
        }));
}

TEST_P(ExtremeMasks, MayCoverEverything) {
  Learn("everything",
        WithMasks([](const View& view) { return std::vector<BinaryMask>{Everything(view)}; }));
}

TEST_P(ExtremeMasks, MayHaveOnePixelEach) {
  Learn("of one pixel", WithMasks([](const View& view) {
          std::vector<BinaryMask> masks = {Everything(view)};
          for (size_t pixel = 0; pixel < NumPixels(view); pixel += 37) {
            masks.emplace_back().pixels.assign(NumPixels(view), 0);
            masks.back().pixels[pixel] = 1;
          }
          return masks;
        }));
}

TEST_P(ExtremeMasks, DuplicatesChangeNothing) {
  const Capture twice = WithMasks([](const View& view) {
    std::vector<BinaryMask> masks;
    masks.reserve(2 * static_cast<size_t>(view.masks.num_masks));
    for (int k = 0; k < 2 * view.masks.num_masks; ++k) {
      masks.push_back(view.masks.Extract(k % view.masks.num_masks));
    }
    return masks;
  });
  const FeatureOptions options = TinyFeatures(100);
  ASSERT_OK_AND_ASSIGN(const StageTwoRun once,
                       RunStageTwo(*backend_, capture_, gaussians_, options));
  ASSERT_OK_AND_ASSIGN(const StageTwoRun again, RunStageTwo(*backend_, twice, gaussians_, options));
  EXPECT_EQ(once.field.features, again.field.features);
}

TEST_P(ExtremeMasks, MayBeAThousandPerView) {
  std::mt19937_64 random(1);
  Learn("a thousand", WithMasks([&](const View& view) {
          std::vector<BinaryMask> masks(1000);
          const auto below = [&](int limit) { return static_cast<int>(random() % limit); };
          for (BinaryMask& mask : masks) {
            mask.pixels.assign(NumPixels(view), 0);
            const int x0 = below(28), y0 = below(28), x1 = x0 + 3 + below(20),
                      y1 = y0 + 3 + below(20);
            for (int y = y0; y < std::min(y1, view.camera.height); ++y) {
              for (int x = x0; x < std::min(x1, view.camera.width); ++x) {
                mask.pixels[size_t(y) * view.camera.width + x] = 1;
              }
            }
          }
          return masks;
        }));
}

}  // namespace
}  // namespace pepeseg::testing
