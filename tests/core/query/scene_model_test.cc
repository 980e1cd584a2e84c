#include "core/query/scene_model.h"

#include <gtest/gtest.h>

#include "core/query/resolve_prompt.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int kSideOfView = 48;

absl::Status Wanted() { return absl::OkStatus(); }

class SceneModelTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_OK_AND_ASSIGN(model_, SceneModel::Create(*backend_, testing::PairOfBlobs(kSideOfView)));
    view_ = model_->model().views[0];
    request_.prompt = {view_, PointsPrompt{{17.5, 24.5, true}}};
    request_.targets = {view_, view_};
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<SceneModel> model_;
  ModelView view_;
  SegmentRequest request_;
};

TEST_F(SceneModelTest, SegmentsOneTargetAfterTheOther) {
  ASSERT_OK_AND_ASSIGN(SegmentedViews views, model_->Segment(request_, Wanted));
  ASSERT_OK_AND_ASSIGN(const Query query, ResolvePrompt(model_->segmenter(), request_.prompt, {}));
  ASSERT_OK_AND_ASSIGN(const auto want, model_->segmenter().Segment(query, {&view_, 1}));
  for (int i = 0; i < 2; ++i) {
    EXPECT_FALSE(views.done());
    ASSERT_OK_AND_ASSIGN(const SegmentResult result, views.Next());
    EXPECT_EQ(result.mask.pixels, want[0].mask.pixels);
    EXPECT_EQ(result.view, view_.name);
    EXPECT_TRUE(result.similarity.empty());
    EXPECT_FALSE(result.box_agreement.has_value());
  }
  EXPECT_TRUE(views.done());
}

TEST_F(SceneModelTest, EndsWithTheErrorOfTheCheck) {
  int num_calls = 0;
  const auto check = [&] {
    return ++num_calls < 3 ? absl::OkStatus() : absl::CancelledError("gone");
  };
  ASSERT_OK_AND_ASSIGN(SegmentedViews views, model_->Segment(request_, check));
  EXPECT_OK(views.Next());
  EXPECT_STATUS(views.Next(), absl::StatusCode::kCancelled, "gone");
}

TEST_F(SceneModelTest, AnswersInPixelsOfThePhotograph) {
  // The photograph is twice as large as the view.
  Lens lens = {.model = LensModel::kPinhole, .width = 2 * kSideOfView, .height = 2 * kSideOfView};
  lens.fx = lens.fy = 50, lens.cx = lens.cy = kSideOfView;
  request_.targets = {view_};
  request_.targets[0].photograph = Photograph{lens, 1, 0, 0, 2 * kSideOfView, 2 * kSideOfView};
  ASSERT_OK_AND_ASSIGN(SegmentedViews views, model_->Segment(request_, Wanted));
  ASSERT_OK_AND_ASSIGN(const SegmentResult large, views.Next());
  EXPECT_EQ(large.width, 2 * kSideOfView);
  request_.frame = FrameKind::kView;
  ASSERT_OK_AND_ASSIGN(SegmentedViews in_view, model_->Segment(request_, Wanted));
  ASSERT_OK_AND_ASSIGN(const SegmentResult small, in_view.Next());
  EXPECT_EQ(small.width, kSideOfView);
  EXPECT_NEAR(static_cast<double>(large.area), 4.0 * static_cast<double>(small.area),
              0.1 * static_cast<double>(large.area));
}

// Empties each mask, and refuses clicks.
class EmptyImages final : public ImageSegmenter {
 public:
  absl::StatusOr<ImageMasks> Click(const ModelView&, std::span<const PointPrompt>, const SoftMask*,
                                   const WantedCheck&) override {
    return absl::UnavailableError("no clicks");
  }
  absl::StatusOr<ImageMasks> Box(const ModelView&, const BoxPrompt&, const WantedCheck&) override {
    return absl::UnavailableError("no boxes");
  }
  absl::Status Refine(const ModelView&, Change change, const WantedCheck&,
                      SegmentResult& result) override {
    EXPECT_EQ(change, Change::kBorder);
    EXPECT_EQ(result.similarity.size(), result.mask.pixels.size());
    SetMask({std::vector<uint8_t>(result.mask.pixels.size())}, result);
    result.border_image = BorderImage::kRendering;
    return absl::OkStatus();
  }
};

TEST_F(SceneModelTest, AsksTheImageSegmenterForTheBorderOfEachMask) {
  EmptyImages images;
  request_.images = &images;
  request_.image_borders = true;
  ASSERT_OK_AND_ASSIGN(SegmentedViews views, model_->Segment(request_, Wanted));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, views.Next());
  EXPECT_EQ(result.area, 0);
  EXPECT_EQ(result.border_image, BorderImage::kRendering);
  EXPECT_TRUE(result.similarity.empty());
}

TEST_F(SceneModelTest, AsksTheImageSegmenterForClicksAndBoxes) {
  EmptyImages images;
  request_.images = &images;
  request_.image_clicks = true;
  EXPECT_STATUS(model_->Segment(request_, Wanted).status(), absl::StatusCode::kUnavailable,
                "no clicks");
  request_.prompt.what = BoxPrompt{10, 16, 13, 16};
  EXPECT_STATUS(model_->Segment(request_, Wanted).status(), absl::StatusCode::kUnavailable,
                "no boxes");
}

TEST_F(SceneModelTest, CutsTheMaskToTheBoxInItsViewOnly) {
  request_.prompt.what = BoxPrompt{10, 16, 13, 16};
  request_.targets[1].name = "another";
  ASSERT_OK_AND_ASSIGN(SegmentedViews views, model_->Segment(request_, Wanted));
  ASSERT_OK_AND_ASSIGN(const SegmentResult cut, views.Next());
  EXPECT_TRUE(cut.box_agreement.has_value());
  ASSERT_OK_AND_ASSIGN(const SegmentResult whole, views.Next());
  EXPECT_FALSE(whole.box_agreement.has_value());
  EXPECT_GE(whole.area, cut.area);
}

TEST_F(SceneModelTest, RendersTheContentAskedFor) {
  RenderRequest request;
  request.view = view_;
  request.share = 0.5;
  ASSERT_OK_AND_ASSIGN(const RenderedView color, model_->Render(request));
  EXPECT_EQ(color.size, (ImageSize{kSideOfView / 2, kSideOfView / 2}));
  EXPECT_EQ(color.color.pixels.size(), size_t{3} * kSideOfView * kSideOfView / 4);
  EXPECT_TRUE(color.depth.empty() && color.ids.empty());
  request.content = RenderContent::kDepth;
  ASSERT_OK_AND_ASSIGN(const RenderedView depth, model_->Render(request));
  EXPECT_EQ(depth.depth.size(), size_t{1} * kSideOfView * kSideOfView / 4);
  EXPECT_TRUE(depth.color.pixels.empty());
}

}  // namespace
}  // namespace pepeseg
