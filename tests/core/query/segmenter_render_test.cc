#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "core/query/segmenter.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSize = 48;
constexpr int kLeft = 24 * kSize + 17, kRight = 24 * kSize + 30;  // pixels in the blobs

// A red blob on the left and a blue one on the right, 3 units away, with orthogonal features.
class SegmenterRender : public ::testing::Test {
 protected:
  void SetUp() override {
    Model model = testing::FrontBlobs(kSize);
    model.field.features[0] = 1;
    model.field.features[32 + 1] = 1;
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, std::move(model)));
    view_ = segmenter_->model().views[0];
  }
  static const uint8_t* At(const Image& image, int pixel) { return &image.pixels[3 * pixel]; }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
  const GaussianSet left_only_ = {{1, 0}};
  const std::vector<int32_t> ids_ = {7, 9};
};

TEST_F(SegmenterRender, RendersASubsetAsIfItWereAlone) {
  ASSERT_OK_AND_ASSIGN(const Image all, segmenter_->RenderColor(view_));
  ASSERT_OK_AND_ASSIGN(const Image left, segmenter_->RenderColor(view_, &left_only_));
  EXPECT_GT(At(left, kLeft)[0], 200);
  EXPECT_EQ(At(left, kRight)[2], 0);
  EXPECT_GT(At(all, kRight)[2], 200);
  const GaussianSet none = {{0, 0}};
  ASSERT_OK_AND_ASSIGN(const Image empty, segmenter_->RenderColor(view_, &none));
  EXPECT_EQ(empty.pixels, std::vector<uint8_t>(empty.pixels.size()));
}

TEST_F(SegmenterRender, ASubsetLeavesTheModelAsItWas) {
  ASSERT_OK_AND_ASSIGN(const Image before, segmenter_->RenderColor(view_));
  const std::vector<int32_t> pixels = {kLeft, kRight};
  ASSERT_OK(segmenter_->RenderColor(view_, &left_only_));
  ASSERT_OK_AND_ASSIGN(const PixelRows rows, segmenter_->Rows(view_, pixels));
  EXPECT_GT(rows.first[2], rows.first[1]) << "the right blob is in its pixel's row";
  ASSERT_OK_AND_ASSIGN(const Image after, segmenter_->RenderColor(view_));
  EXPECT_EQ(after.pixels, before.pixels);
}

TEST_F(SegmenterRender, DepthIsAlongTheAxisAndZeroWhereNothingIs) {
  ASSERT_OK_AND_ASSIGN(const std::vector<float> depth, segmenter_->RenderDepth(view_));
  ASSERT_EQ(depth.size(), size_t{kSize} * kSize);
  EXPECT_NEAR(depth[kLeft], 3, 1e-3);
  EXPECT_NEAR(depth[kRight], 3, 1e-3);
  EXPECT_EQ(depth[0], 0);
  ASSERT_OK_AND_ASSIGN(const std::vector<float> left, segmenter_->RenderDepth(view_, &left_only_));
  EXPECT_NEAR(left[kLeft], 3, 1e-3);
  EXPECT_EQ(left[kRight], 0);
  // A smaller image after a larger one, and colour after depth, write no more than their own size.
  ModelView small = view_;
  small.camera = {16, 16, 13, 13, 8, 8};
  ASSERT_OK_AND_ASSIGN(const std::vector<float> of_small, segmenter_->RenderDepth(small));
  EXPECT_EQ(of_small.size(), 256u);
  EXPECT_OK(segmenter_->RenderColor(view_));
}

TEST_F(SegmenterRender, FeaturesHaveOneColourInAllViews) {
  ASSERT_OK_AND_ASSIGN(const Image front, segmenter_->RenderFeatures(view_, 0.5));
  EXPECT_EQ(At(front, 0)[0], 0) << "black where nothing is";
  EXPECT_GT(std::abs(At(front, kLeft)[0] - At(front, kRight)[0]), 200) << "the first component";
  ModelView beside = view_;
  beside.cam_from_world.translation = {-0.5, 0, 0};  // the right blob is in the middle
  ASSERT_OK_AND_ASSIGN(const Image other, segmenter_->RenderFeatures(beside, 0.5));
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(At(other, 24 * kSize + 24)[k], At(front, kRight)[k], 1);
  }
  EXPECT_STATUS(segmenter_->RenderFeatures(view_, NAN), absl::StatusCode::kInvalidArgument,
                "scale is nan");
}

TEST_F(SegmenterRender, IdsAndFeaturesOfASubsetAreOfItAlone) {
  ASSERT_OK_AND_ASSIGN(const auto all, segmenter_->RenderIds(view_, ids_));
  EXPECT_EQ(all[kLeft], 7);
  EXPECT_EQ(all[kRight], 9);
  EXPECT_EQ(all[0], 0);
  ASSERT_OK_AND_ASSIGN(const auto left, segmenter_->RenderIds(view_, ids_, &left_only_));
  EXPECT_EQ(left[kLeft], 7);
  EXPECT_EQ(left[kRight], 0);
  ASSERT_OK_AND_ASSIGN(const Image features, segmenter_->RenderFeatures(view_, 0.5, &left_only_));
  ASSERT_OK_AND_ASSIGN(const Image both, segmenter_->RenderFeatures(view_, 0.5));
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(At(features, kLeft)[k], At(both, kLeft)[k]);
    EXPECT_EQ(At(features, kRight)[k], 0);
  }
}

TEST_F(SegmenterRender, RefusesInvalidViewsScalesAndSubsets) {
  const GaussianSet other = {{1, 0, 1}};
  constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
  EXPECT_STATUS(segmenter_->RenderColor(view_, &other), kInvalid,
                "of 3 Gaussians, the model has 2");
  EXPECT_STATUS(segmenter_->RenderDepth(view_, &other), kInvalid, "of 3 Gaussians");
  EXPECT_STATUS(segmenter_->RenderFeatures(view_, 0.5, &other), kInvalid, "of 3 Gaussians");
  EXPECT_STATUS(segmenter_->RenderIds(view_, ids_, &other), kInvalid, "of 3 Gaussians");
  EXPECT_STATUS(segmenter_->RenderIds(view_, std::vector<int32_t>{1}), kInvalid, "1 ids");
  EXPECT_STATUS(segmenter_->WithDecomposition(std::vector<double>{2},
                                              [](const auto&) { return absl::OkStatus(); }),
                kInvalid, "scale 0 is 2");
  ModelView bad = view_;
  bad.camera.width = 0;
  EXPECT_STATUS(segmenter_->RenderDepth(bad), kInvalid, "size is 0x48");
  EXPECT_STATUS(segmenter_->RenderFeatures(bad, 0.5), kInvalid, "size is 0x48");
  EXPECT_STATUS(segmenter_->RenderIds(bad, ids_), kInvalid, "size is 0x48");
}

TEST_F(SegmenterRender, SubsetsFromSeveralThreadsDoNotMix) {
  ASSERT_OK_AND_ASSIGN(const Image all, segmenter_->RenderColor(view_));
  ASSERT_OK_AND_ASSIGN(const Image left, segmenter_->RenderColor(view_, &left_only_));
  std::vector<int> wrong(4);
  std::vector<std::thread> threads;
  threads.reserve(wrong.size());
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) {
        const auto got = segmenter_->RenderColor(view_, t % 2 == 0 ? nullptr : &left_only_);
        wrong[t] += got.ok() && got->pixels == (t % 2 == 0 ? all : left).pixels ? 0 : 1;
        const auto ids = segmenter_->RenderIds(view_, ids_);
        wrong[t] += ids.ok() && (*ids)[kRight] == 9 ? 0 : 1;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4));
}

}  // namespace
}  // namespace pepeseg
