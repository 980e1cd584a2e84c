#include <gtest/gtest.h>

#include <filesystem>

#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

constexpr char kSecond[] = "scenes/shelf/models/2";
constexpr char kFirst[] = "scenes/shelf/models/1";

// Corrections of the model of ShelfModel: the lower half of its red square is to be a thing of its
// own.
struct CorrectSegmentTest : ShelfModel {
  CorrectSegmentTest() { request.set_model(kModel); }

  // A mask of all pixels whose column and row are in these ranges.
  static v1::MaskImage Rectangle(int left, int right, int top, int bottom) {
    std::vector<uint8_t> mask(size_t{kWidth} * kHeight);
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) mask[size_t{kWidth} * y + x] = 1;
    }
    v1::MaskImage image;
    image.mutable_rle()->set_width(kWidth);
    image.mutable_rle()->set_height(kHeight);
    image.mutable_rle()->set_counts(EncodeCocoRle({mask}, kWidth, kHeight));
    return image;
  }
  static v1::MaskImage LowerHalf() { return Rectangle(15, 45, 32, 47); }
  void Add(const std::string& view, const v1::MaskImage& mask) {
    auto& correction = *request.add_corrections();
    correction.mutable_view()->set_view(view);
    *correction.mutable_mask() = mask;
  }
  Reply<v1::CorrectSegmentResponse> Correct() const {
    return Call(&SegmentationStub::CorrectSegment, request);
  }
  // Returns the area of the answer in view right.jpg to a click in middle.jpg on the lower half.
  int64_t AreaOfClick(const std::string& model, const v1::CorrectSegmentResponse& at) const {
    auto click = Click<v1::SegmentViewsRequest>(30, 40);
    click.set_model(model);
    click.mutable_granularity()->set_scale_quantile(at.scale_quantile());
    click.mutable_granularity()->set_threshold(at.threshold());
    click.mutable_targets()->add_views("right.jpg");
    return Call(&SegmentationStub::SegmentViews, click)->masks(0).area();
  }
  std::string Live() const {
    return Call(&SceneStub::GetScene, Named{"scenes/shelf"})->live_model();
  }

  v1::CorrectSegmentRequest request;
};

TEST_F(CorrectSegmentTest, MakesANewModelThatKnowsTheThing) {
  Add("middle.jpg", LowerHalf());
  const auto answer = Correct();
  ASSERT_OK(answer);
  EXPECT_EQ(answer->model(), kSecond);
  EXPECT_EQ(answer->corrected_from(), kFirst);
  ASSERT_EQ(answer->scores_size(), 1);
  EXPECT_EQ(answer->scores(0).view(), "middle.jpg");
  EXPECT_LT(answer->scores(0).iou_before(), 0.6);
  EXPECT_GT(answer->scores(0).iou_after(), 0.8);
  EXPECT_GT(answer->num_changed(), 0);
  EXPECT_TRUE(answer->timing().has_compute());
  EXPECT_EQ(Live(), kSecond);
  const int64_t before = AreaOfClick(kFirst, *answer), after = AreaOfClick(kModel, *answer);
  EXPECT_GT(before, 700) << "the square";
  EXPECT_GT(after, 300);
  EXPECT_LT(after, 600) << "its lower half";
  const auto model = Call(&SceneStub::GetModel, Named{kSecond});
  EXPECT_EQ(model->corrected_from(), kFirst);
  EXPECT_EQ(model->job(), "jobs/j1");
  EXPECT_EQ(model->metrics().at("psnr"), 30);
  EXPECT_TRUE(Call(&SceneStub::GetModel, Named{kFirst})->corrected_from().empty());
}

TEST_F(CorrectSegmentTest, IsUndoneByMakingTheFormerModelLive) {
  Add("middle.jpg", LowerHalf());
  const auto answer = Correct();
  ASSERT_OK(answer);
  const auto scene = Call(&SceneStub::SetLiveModel, Named{kFirst});
  ASSERT_OK(scene);
  EXPECT_EQ(scene->live_model(), kFirst);
  EXPECT_EQ(Live(), kFirst);
  EXPECT_GT(AreaOfClick(kModel, *answer), 700);
  EXPECT_OK(Call(&SceneStub::SetLiveModel, Named{kSecond})) << "and done again";
  EXPECT_EQ(Live(), kSecond);
  EXPECT_ERROR(Call(&SceneStub::SetLiveModel, Named{"scenes/shelf/models/9"}), grpc::NOT_FOUND);
  EXPECT_ERROR(Call(&SceneStub::SetLiveModel, Named{"models/1"}), grpc::INVALID_ARGUMENT);
}

TEST_F(CorrectSegmentTest, SurvivesARestartAndTheDeletionOfTheFormerModel) {
  Add("middle.jpg", LowerHalf());
  const auto answer = Correct();
  ASSERT_OK(answer);
  ASSERT_OK(Call(&SceneStub::DeleteModel, Named{kFirst}));
  running.Restart();
  EXPECT_EQ(Live(), kSecond);
  EXPECT_LT(AreaOfClick(kModel, *answer), 600);
  const auto folder = running.options.data / "models/1/2";
  EXPECT_TRUE(std::filesystem::exists(folder / "gaussians.ply"));
  ASSERT_OK(Call(&SceneStub::DeleteModel, Named{kSecond}));
  EXPECT_FALSE(std::filesystem::exists(folder));
  EXPECT_ERROR(Correct(), grpc::FAILED_PRECONDITION, {.reason = "NO_MODEL"});
}

TEST_F(CorrectSegmentTest, LeavesTheModelThatWasLiveBeforeWhenItIsDeleted) {
  Add("middle.jpg", LowerHalf());
  ASSERT_OK(Correct());
  ASSERT_OK(Call(&SceneStub::DeleteModel, Named{kSecond}));
  EXPECT_EQ(Live(), kFirst);
}

TEST_F(CorrectSegmentTest, CorrectsACorrectedModel) {
  Add("middle.jpg", LowerHalf());
  ASSERT_OK(Correct());
  request.clear_corrections();
  Add("middle.jpg", Rectangle(51, 81, 32, 47));
  const auto second = Correct();
  ASSERT_OK(second);
  EXPECT_EQ(second->model(), "scenes/shelf/models/3");
  EXPECT_EQ(second->corrected_from(), kSecond);
}

TEST_F(CorrectSegmentTest, RefusesMasksThatTeachNothing) {
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, "corrections", "1..16");
  const auto refuse = [&](const std::string& view, const v1::MaskImage& mask,
                          const std::string& field, const std::string& words) {
    request.clear_corrections();
    Add(view, mask);
    EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, field, words);
  };
  refuse("middle.jpg", Rectangle(0, 0, 0, 0), "corrections[0].mask", "");
  refuse("middle.jpg", Rectangle(0, kWidth, 0, kHeight), "corrections[0].mask", "covers all");
  refuse("middle.jpg", Rectangle(0, 4, 0, 4), "corrections[0].mask", "nothing with a feature");
  refuse("none.jpg", LowerHalf(), "corrections[0].view.view", "");
  refuse("middle.jpg", {}, "corrections[0].mask", "");
  EXPECT_EQ(Live(), kFirst) << "nothing was made";
}

TEST_F(CorrectSegmentTest, RefusesMasksThatContradictEachOther) {
  Add("middle.jpg", LowerHalf());
  Add("middle.jpg", LowerHalf());
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, "corrections[1].view", "named twice");
  request.mutable_corrections(1)->mutable_view()->set_view("right.jpg");
  *request.mutable_corrections(1)->mutable_mask() = Rectangle(48, 78, 17, 47);
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, "corrections[0].mask", "contradicts");
}

TEST_F(CorrectSegmentTest, RefusesTooManyMasksAndAThreshold) {
  for (int i = 0; i < 17; ++i) Add("middle.jpg", LowerHalf());
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, "corrections", "1..16");
  request.clear_corrections();
  Add("middle.jpg", LowerHalf());
  request.mutable_granularity()->set_threshold(0.5);
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT, "granularity.threshold");
  request.mutable_granularity()->clear_threshold();
  request.mutable_granularity()->set_scale_quantile(2);
  EXPECT_ERROR(Correct(), grpc::INVALID_ARGUMENT);
}

TEST(CorrectSegment, RefusesAModelWithoutFeatures) {
  struct Bare : ServiceTest {
    Bare() : ServiceTest(PEPESEG_MODEL_WORKER) {}
    void TestBody() override {}
  } bare;
  bare.running.CreateScene("bare");
  bare.TrainToTheEnd("bare", "bare");
  v1::CorrectSegmentRequest request;
  request.set_model("scenes/bare/models/live");
  request.add_corrections()->mutable_mask()->mutable_rle();
  EXPECT_ERROR(bare.Call(&SegmentationStub::CorrectSegment, request), grpc::FAILED_PRECONDITION,
               {.reason = "NO_FEATURES", .resource = "scenes/bare/models/1"});
}

}  // namespace
}  // namespace pepeseg
