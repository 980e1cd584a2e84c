#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/rendered.h"

// Sums of blend weights after a backward pass, against sums over blend rows.

namespace pepeseg {
namespace {

constexpr int kWidth = 53, kHeight = 39, kNumPixels = kWidth * kHeight;
constexpr int64_t kCount = 400;

class AddWeightsTest : public BackendTest {
 protected:
  void SetUp() override {
    BackendTest::SetUp();
    if (backend_ == nullptr) return;
    scene_ = std::make_unique<Rendered>(*backend_,
                                        RandomScene({.count = kCount, .max_opacity_logit = 6}),
                                        TestView(kWidth, kHeight));
    scene_->Render();
  }
  void TearDown() override {
    scene_.reset();
    BackendTest::TearDown();
  }

  // Returns the sums over blend rows of each Gaussian's weights, each times that of its pixel.
  std::vector<double> SumsOfRows(std::span<const float> of_pixel) {
    std::vector<int32_t> all(kNumPixels);
    std::iota(all.begin(), all.end(), 0);
    const Buffer<int32_t> pixels(*backend_, std::span<const int32_t>(all));
    Buffer<int32_t> first, gaussian;
    Buffer<float> weight;
    backend_->CaptureRows({.pixels = pixels.span(),
                           .scratch = &scene_->scratch,
                           .row_first = &first,
                           .entry_gaussian = &gaussian,
                           .entry_weight = &weight});
    const auto firsts = Download(first), gaussians = Download(gaussian);
    const auto weights = Download(weight);
    std::vector<double> sums(kCount);
    for (int p = 0; p < kNumPixels; ++p) {
      for (int32_t e = firsts[p]; e < firsts[p + 1]; ++e) {
        sums[gaussians[e]] += double{of_pixel[p]} * double{weights[e]};
      }
    }
    return sums;
  }

  std::unique_ptr<Rendered> scene_;
};
INSTANTIATE_TEST_SUITE_P(Backends, AddWeightsTest, AllBackends(), BackendName);

// Three sets of pixels: all, a third, and one.
std::vector<float> ThreeSets() {
  std::vector<float> sets(3 * kNumPixels);
  for (int p = 0; p < kNumPixels; ++p) {
    sets[p] = 1;
    sets[kNumPixels + p] = p % 3 == 0 ? 1.0f : 0.0f;
  }
  sets[2 * kNumPixels + kNumPixels / 2] = 1;
  return sets;
}

TEST_P(AddWeightsTest, AddsTheSumsOfTheBlendRows) {
  const std::vector<float> sets = ThreeSets();
  scene_->Backward(sets);
  for (int num_planes = 1; num_planes <= 3; ++num_planes) {
    SCOPED_TRACE(num_planes);
    const std::vector<float> before = RandomValues(num_planes * kCount, 5);
    Buffer<float> sums = Upload(*backend_, before);
    backend_->AddWeights(
        {.scratch = &scene_->scratch, .num_planes = num_planes, .sums = sums.span()});
    const std::vector<float> got = Download(sums);
    for (int k = 0; k < num_planes; ++k) {
      const auto want = SumsOfRows(std::span(sets).subspan(k * kNumPixels, kNumPixels));
      int num_seen = 0;
      for (int64_t i = 0; i < kCount; ++i) {
        const float old = before[k * kCount + i];
        if (want[i] > 0) ++num_seen;
        ASSERT_NEAR(got[k * kCount + i], old + want[i], 1e-5 + 1e-5 * want[i]) << k << " " << i;
      }
      EXPECT_GT(num_seen, k == 2 ? 3 : 100);
    }
  }
}

TEST_P(AddWeightsTest, ChangesNoSumOfAGaussianThatIsNotVisible) {
  scene_->Backward(std::vector<float>(3 * kNumPixels, 1.0f));
  const std::vector<float> before = RandomValues(kCount, 5);
  Buffer<float> sums = Upload(*backend_, before);
  backend_->AddWeights({.scratch = &scene_->scratch, .num_planes = 1, .sums = sums.span()});
  const std::vector<float> got = Download(sums);
  std::vector<bool> is_visible(kCount);
  for (const int32_t i : Download(scene_->scratch.visible_gaussian)) is_visible[i] = true;
  int num_hidden = 0;
  for (int64_t i = 0; i < kCount; ++i) {
    if (is_visible[i]) continue;
    ++num_hidden;
    EXPECT_EQ(got[i], before[i]) << i;
  }
  EXPECT_GT(num_hidden, 0);
}

TEST_P(AddWeightsTest, AddsNothingForPixelsWithoutAGradient) {
  scene_->Backward(std::vector<float>(3 * kNumPixels));
  const std::vector<float> before = RandomValues(3 * kCount, 5);
  Buffer<float> sums = Upload(*backend_, before);
  backend_->AddWeights({.scratch = &scene_->scratch, .num_planes = 3, .sums = sums.span()});
  EXPECT_EQ(Download(sums), before);
}

}  // namespace
}  // namespace pepeseg
