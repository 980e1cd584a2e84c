#include "core/query/segmenter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/point_gaussians.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSide = 48;

// The blobs of FrontBlobs with orthogonal features.
Model TwoBlobs() {
  Model model = testing::FrontBlobs(kSide);
  model.field.features[0] = 1;
  model.field.features[32 + 1] = 1;
  return model;
}

class SegmenterTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(segmenter_, Segmenter::Create(*backend_, TwoBlobs()));
    view_ = segmenter_->model().views[0];
    points_ = {{kLeftX, kY, true}};
  }
  absl::StatusOr<std::vector<SegmentResult>> Ask(const SegmentOptions& options = {}) const {
    return AskIn(segmenter_->model().views, options);
  }
  absl::StatusOr<std::vector<SegmentResult>> AskIn(std::span<const ModelView> targets,
                                                   const SegmentOptions& options = {}) const {
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(*segmenter_, {view_, points_}, {scale_, threshold_}));
    return segmenter_->Segment(query, targets, options);
  }
  void ExpectInvalid(const std::string& message) const {
    EXPECT_STATUS(Ask(), absl::StatusCode::kInvalidArgument, message);
  }

  static constexpr double kLeftX = 17.5, kRightX = 30.5, kY = 24.5;
  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter_;
  ModelView view_;
  std::vector<PointPrompt> points_;
  double scale_ = 0.5, threshold_ = 0.75;
};

TEST_F(SegmenterTest, FindsTheClickedBlobOnly) {
  ASSERT_OK_AND_ASSIGN(const auto results, Ask({.want_similarity = true}));
  ASSERT_EQ(results.size(), 1u);
  const SegmentResult& result = results[0];
  EXPECT_EQ(result.mask.pixels[24 * kSide + 17], 1);
  EXPECT_EQ(result.mask.pixels[24 * kSide + 30], 0);
  EXPECT_EQ(result.mask.pixels[0], 0);
  EXPECT_GT(result.score, 0.9);
  EXPECT_EQ(result.scale, 0.5);
  EXPECT_NEAR(result.scale_units, 2, 1e-6);
  ASSERT_EQ(result.similarity.size(), size_t{kSide} * kSide);
  EXPECT_NEAR(result.similarity[24 * kSide + 17], 1, 1e-3);
  EXPECT_LT(result.similarity[24 * kSide + 30], 0.5);
}

// Area, box and score are those of the refined mask.
TEST_F(SegmenterTest, RefinesBorders) {
  threshold_ = 0.97;  // too high between the blobs
  ASSERT_OK_AND_ASSIGN(const auto plain, Ask());
  ASSERT_OK_AND_ASSIGN(const auto results, Ask({.refine_borders = true}));
  const SegmentResult& result = results[0];
  EXPECT_TRUE(result.similarity.empty());
  EXPECT_NE(result.mask.pixels, plain[0].mask.pixels);
  int64_t num_moved = 0, area = 0;
  int box[4] = {};
  FindBox(result.mask.pixels, kSide, box);
  for (size_t i = 0; i < result.mask.pixels.size(); ++i) {
    area += result.mask.pixels[i];
    num_moved += result.mask.pixels[i] != plain[0].mask.pixels[i] ? 1 : 0;
  }
  EXPECT_LT(num_moved, plain[0].area / 4);
  EXPECT_EQ(result.area, area);
  EXPECT_TRUE(std::ranges::equal(result.box, box));

  ASSERT_OK_AND_ASSIGN(const auto both, Ask({.want_similarity = true, .refine_borders = true}));
  EXPECT_EQ(both[0].mask.pixels, result.mask.pixels);
  double sum = 0;
  for (size_t i = 0; i < both[0].similarity.size(); ++i) {
    if (result.mask.pixels[i] != 0) sum += double{both[0].similarity[i]};
  }
  EXPECT_NEAR(result.score, sum / static_cast<double>(area), 1e-6);  // sums are rounded
}

TEST_F(SegmenterTest, LeavesAnEmptyMaskEmptyWhenItRefinesBorders) {
  threshold_ = 1;
  ASSERT_OK_AND_ASSIGN(const auto results, Ask({.refine_borders = true}));
  EXPECT_EQ(results[0].area, 0);
  EXPECT_EQ(results[0].score, 0);
}

// A thin veil in front of both blobs has a feature of its own; a click through it finds the blob.
TEST_F(SegmenterTest, AClickGoesThroughWhatHardlyAnyViewShows) {
  const auto click = [&](std::vector<float> confidence) -> absl::StatusOr<std::vector<float>> {
    Capture capture;
    capture.points.push_back({Eigen::Vector3f(-0.5f, 0, 3), {255, 0, 0}});
    capture.points.push_back({Eigen::Vector3f(0.5f, 0, 3), {0, 0, 255}});
    capture.points.push_back({Eigen::Vector3f(0, 0, 1), {255, 255, 255}});
    Model model = TwoBlobs();
    model.gaussians = testing::PointGaussians(capture, 0.12f);
    for (int k = 0; k < 3; ++k) model.gaussians.Plane(kLogScalePlane + k)[2] = std::log(0.5f);
    model.gaussians.Plane(kOpacityPlane)[2] = 1;  // over 0.7
    model.field.features.resize(3 * 32, 0.0f);
    model.field.features[2 * 32 + 2] = 1;
    model.field.confidence = std::move(confidence);
    ASSIGN_OR_RETURN(const auto segmenter, Segmenter::Create(*backend_, std::move(model)));
    return segmenter->PointFeatures(view_, points_);
  };
  ASSERT_OK_AND_ASSIGN(const auto veiled, click({}));
  EXPECT_LT(veiled[0], veiled[2]);
  ASSERT_OK_AND_ASSIGN(const auto through, click({1, 1, 0.02f}));
  EXPECT_GT(through[0], 0.9f);
  EXPECT_LT(through[2], 0.1f);
  EXPECT_STATUS(click({1, 1}), absl::StatusCode::kInvalidArgument,
                "2 confidences for its 3 Gaussians");
}

TEST_F(SegmenterTest, BoxContainsTheMask) {
  ASSERT_OK_AND_ASSIGN(const auto results, Ask());
  int min_x = kSide, max_x = -1, min_y = kSide, max_y = -1;
  for (int i = 0; i < kSide * kSide; ++i) {
    if (results[0].mask.pixels[i] == 0) continue;
    min_x = std::min(min_x, i % kSide), max_x = std::max(max_x, i % kSide);
    min_y = std::min(min_y, i / kSide), max_y = std::max(max_y, i / kSide);
  }
  EXPECT_EQ(results[0].box[0], min_x);
  EXPECT_EQ(results[0].box[1], min_y);
  EXPECT_EQ(results[0].box[2], max_x - min_x + 1);
  EXPECT_EQ(results[0].box[3], max_y - min_y + 1);
  EXPECT_TRUE(results[0].similarity.empty());
}

TEST_F(SegmenterTest, TwoPositivePointsTakeBothAndANegativeOneTakesBack) {
  points_.push_back({kRightX, kY, true});
  ASSERT_OK_AND_ASSIGN(const auto both, Ask());
  EXPECT_EQ(both[0].mask.pixels[24 * kSide + 17], 1);
  EXPECT_EQ(both[0].mask.pixels[24 * kSide + 30], 1);
  points_.push_back({kRightX, kY, false});
  ASSERT_OK_AND_ASSIGN(const auto one, Ask());
  EXPECT_EQ(one[0].mask.pixels[24 * kSide + 17], 1);
  EXPECT_EQ(one[0].mask.pixels[24 * kSide + 30], 0);
}

TEST_F(SegmenterTest, FreeCamerasAreTargetsAndPromptViews) {
  ModelView target = view_;
  target.name.clear();
  target.camera = {64, 40, 50, 50, 30, 20};
  target.cam_from_world.translation = {0.1, 0, 0.2};
  const std::vector<ModelView> targets = {view_, target};
  ASSERT_OK_AND_ASSIGN(const auto results, AskIn(targets));
  ASSERT_EQ(results.size(), 2u);
  EXPECT_EQ(results[1].width, 64);
  EXPECT_EQ(results[1].height, 40);
  // The left blob, as that camera sees it.
  const int x = static_cast<int>(50 * (-0.5 + 0.1) / 3.2 + 30);
  EXPECT_EQ(results[1].mask.pixels[20 * 64 + x], 1);

  view_ = target;
  points_ = {{x + 0.5, 20.5, true}};
  ASSERT_OK_AND_ASSIGN(const auto back, Ask());
  EXPECT_EQ(back[0].mask.pixels[24 * kSide + 17], 1);
}

TEST_F(SegmenterTest, AnEmptyMaskHasNoBoxAndNoScore) {
  ModelView away = view_;
  away.cam_from_world.translation = {0, 0, -50};  // everything is behind it
  ASSERT_OK_AND_ASSIGN(const auto results, AskIn({&away, 1}));
  EXPECT_EQ(results[0].score, 0);
  for (const int value : results[0].box) EXPECT_EQ(value, 0);
}

TEST_F(SegmenterTest, RendersColour) {
  ASSERT_OK_AND_ASSIGN(const Image image, segmenter_->RenderColor(view_));
  const uint8_t* left = &image.pixels[(24 * kSide + 17) * 3];
  EXPECT_GT(left[0], 200);
  EXPECT_LT(left[2], 50);
  EXPECT_EQ(image.pixels[0], 0);
}

TEST_F(SegmenterTest, QueriesFromSeveralThreadsAgree) {
  ASSERT_OK_AND_ASSIGN(const auto want, Ask());
  std::vector<std::thread> threads;
  std::vector<int> wrong(4);
  threads.reserve(wrong.size());
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 20; ++i) {
        const auto got = Ask();
        wrong[t] += got.ok() && (*got)[0].mask.pixels == want[0].mask.pixels ? 0 : 1;
        wrong[t] += segmenter_->RenderColor(view_).ok() ? 0 : 1;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4));
}

TEST_F(SegmenterTest, SimilarityToThePointFeaturesIsThatOfTheQuery) {
  const ModelView& view = view_;
  const std::vector<PointPrompt> points = {{kRightX, kY, true}, {kLeftX, kY, true}};
  ASSERT_OK_AND_ASSIGN(const auto features, segmenter_->PointFeatures(view, points));
  ASSERT_EQ(features.size(), 2u * 32);
  ASSERT_OK_AND_ASSIGN(const auto similarity, segmenter_->Similarity(features, 0.5, view));
  ASSERT_EQ(similarity.size(), 2u * kSide * kSide);
  ASSERT_OK_AND_ASSIGN(const auto left, Ask({.want_similarity = true}));
  EXPECT_EQ(std::vector<float>(similarity.begin() + kSide * kSide, similarity.end()),
            left[0].similarity);
  EXPECT_STATUS(segmenter_->PointFeatures(view, std::vector<PointPrompt>{{1.5, 1.5, true}}),
                absl::StatusCode::kInvalidArgument, "nothing with a feature is rendered there");
  EXPECT_STATUS(segmenter_->Similarity(features, 1.5, view), absl::StatusCode::kInvalidArgument,
                "scale_quantile is 1.5");
  EXPECT_STATUS(segmenter_->Similarity(std::vector<float>(31), 0.5, view),
                absl::StatusCode::kInvalidArgument, "31 feature values");
}

TEST_F(SegmenterTest, RefusesPromptsItCannotAnswer) {
  points_ = {};
  ExpectInvalid("no positive point");
  points_ = {{kLeftX, kY, false}};
  ExpectInvalid("no positive point");
  points_ = {{kLeftX, kY, true}, {48, 3, true}};
  ExpectInvalid("point 48,3 is outside view \"front\" (48x48)");
  points_ = {{NAN, 3, true}};
  ExpectInvalid("points[0]: (nan, 3) is not finite");
  points_ = {{-0.1, 3, true}};
  ExpectInvalid("point -0.1,3 is outside");
  points_ = {{1.5, 1.5, true}};
  ExpectInvalid("nothing with a feature is rendered there");
  points_ = {{kLeftX, kY, true}};
  scale_ = 1.01;
  ExpectInvalid("scale_quantile is 1.01, not in [0, 1]");
  scale_ = NAN;
  ExpectInvalid("scale_quantile is nan");
  scale_ = 0.5;
  threshold_ = -1.5;
  ExpectInvalid("threshold is -1.5, not in [-1, 1]");
}

TEST_F(SegmenterTest, RefusesInvalidCameras) {
  const ModelView good = view_;
  const auto expect_refused = [&](const ModelView& view, const std::string& message) {
    EXPECT_STATUS(AskIn({&view, 1}), absl::StatusCode::kInvalidArgument, message);
    EXPECT_STATUS(segmenter_->RenderColor(view), absl::StatusCode::kInvalidArgument, message);
  };
  ModelView view = good;
  view.camera.fx = NAN;
  expect_refused(view, "camera.fx is nan");
  view = good;
  view.camera.width = 1 << 20;
  expect_refused(view, "camera: 1048576 x 48 pixels");
  view = good;
  view.camera.height = 0;
  expect_refused(view, "camera: 48 x 0 pixels");
  view = good;
  view.cam_from_world.rotation.coeffs().setZero();
  expect_refused(view, "rotation");
  view = good;
  view.cam_from_world.translation.y() = INFINITY;
  view.name.clear();
  expect_refused(view, "cam_from_world.translation");
}

TEST(SegmenterCreate, RefusesAModelWithoutItsFeatures) {
  const auto backend = MakeCpuBackend(1);
  Model model = TwoBlobs();
  model.field.features.pop_back();
  EXPECT_STATUS(Segmenter::Create(*backend, std::move(model)), absl::StatusCode::kInvalidArgument,
                "63 feature values, must be 64");
  EXPECT_STATUS(Segmenter::Create(*backend, Model()), absl::StatusCode::kInvalidArgument,
                "no Gaussian");
}

constexpr int kLeft = 24 * kSide + 17, kRight = 24 * kSide + 30;  // pixels in the blobs

// A red blob on the left and a blue one on the right, 3 units away, with orthogonal features.
class SegmenterRender : public ::testing::Test {
 protected:
  void SetUp() override {
    Model model = testing::FrontBlobs(kSide);
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
  ASSERT_EQ(depth.size(), size_t{kSide} * kSide);
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
  ModelView next_to = view_;
  next_to.cam_from_world.translation = {-0.5, 0, 0};  // the right blob is in the middle
  ASSERT_OK_AND_ASSIGN(const Image other, segmenter_->RenderFeatures(next_to, 0.5));
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(At(other, 24 * kSide + 24)[k], At(front, kRight)[k], 1);
  }
  EXPECT_STATUS(segmenter_->RenderFeatures(view_, NAN), absl::StatusCode::kInvalidArgument,
                "scale_quantile is nan");
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
                kInvalid, "[0] is 2, not in [0, 1]");
  ModelView bad = view_;
  bad.camera.width = 0;
  EXPECT_STATUS(segmenter_->RenderDepth(bad), kInvalid, "0 x 48 pixels");
  EXPECT_STATUS(segmenter_->RenderFeatures(bad, 0.5), kInvalid, "0 x 48 pixels");
  EXPECT_STATUS(segmenter_->RenderIds(bad, ids_), kInvalid, "0 x 48 pixels");
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
