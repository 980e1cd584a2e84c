#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/formats/images.h"
#include "core/formats/rle.h"
#include "tests/server/shelf_model.h"

namespace pepeseg {
namespace {

constexpr char kFirst[] = "scenes/shelf/models/1", kSecond[] = "scenes/shelf/models/2";
constexpr int64_t kNumOfSegment = 10'000;

struct EditModelTest : ShelfModel {
  EditModelTest() {
    request.set_model(kModel);
    SetSegment(1, 1, *request.mutable_subset());  // the red square
  }
  grpc::Status Edit() {
    grpc::ClientContext context;
    const auto stream = running.edits->EditModel(&context, request);
    result.Clear();
    num_progress = 0;
    for (v1::EditModelResponse part; stream->Read(&part);) {
      EXPECT_FALSE(result.has_timing()) << "the result is the last part";
      if (part.has_result()) result = part.result();
      num_progress += part.has_progress() ? 1 : 0;
    }
    return stream->Finish();
  }
  v1::Model Model(const std::string& name) const {
    return *Call(&SceneStub::GetModel, Named{name});
  }
  std::string Live() const {
    return Call(&SceneStub::GetScene, Named{"scenes/shelf"})->live_model();
  }
  // Returns red, green and blue of a pixel of view middle.jpg.
  std::vector<int> ColorAt(int x, int y = 32) {
    v1::RenderViewRequest render;
    render.set_model(kModel);
    render.mutable_viewpoint()->set_view("middle.jpg");
    const auto path = running.folder / "picture.png";
    std::ofstream(path, std::ios::binary) << Call(&RenderStub::RenderView, render)->png();
    const auto image = DecodePhoto(path, "picture.png");
    EXPECT_OK(image);
    const uint8_t* rgb = image->pixels.data() + 3 * (y * kWidth + x);
    return {rgb[0], rgb[1], rgb[2]};
  }

  v1::EditModelRequest request;
  v1::EditModelResponse::Result result;
  int num_progress = 0;
};

TEST_F(EditModelTest, RemovesAndUndoes) {
  EXPECT_GT(ColorAt(30)[0], 100);
  request.mutable_remove();
  ASSERT_OK(Edit());
  EXPECT_EQ(result.model(), kSecond);
  EXPECT_EQ(result.edited_from(), kFirst);
  EXPECT_EQ(result.num_removed(), kNumOfSegment);
  EXPECT_EQ(result.num_added() + result.num_changed(), 0);
  EXPECT_EQ(result.selection(), "");
  EXPECT_TRUE(result.timing().has_compute());
  EXPECT_EQ(Live(), kSecond);
  const v1::Model first = Model(kFirst), second = Model(kSecond);
  EXPECT_EQ(second.num_gaussians(), first.num_gaussians() - kNumOfSegment);
  EXPECT_EQ(second.edited_from(), kFirst);
  EXPECT_EQ(second.corrected_from(), "");
  EXPECT_EQ(second.edit(), "removed 10000 Gaussians");
  EXPECT_EQ(second.job(), "jobs/j1");
  EXPECT_EQ(second.metrics_size(), 0);
  EXPECT_EQ(first.edited_from() + first.edit(), "");
  EXPECT_LT(ColorAt(30)[0], 20);
  EXPECT_GT(ColorAt(66)[2], 100) << "the blue square stays";
  // The features of what stays are its own.
  const auto click = Call(&SegmentationStub::SegmentViews, Click<v1::SegmentViewsRequest>(66));
  EXPECT_GT(click->masks(0).area(), 700);
  ASSERT_OK(Call(&SceneStub::SetLiveModel, Named{kFirst}));
  EXPECT_GT(ColorAt(30)[0], 100);
}

TEST_F(EditModelTest, CropsToTheComplement) {
  request.mutable_remove();
  request.mutable_subset()->set_complement(true);
  ASSERT_OK(Edit());
  EXPECT_EQ(Model(kSecond).num_gaussians(), kNumOfSegment);
  EXPECT_GT(ColorAt(30)[0], 100);
  EXPECT_LT(ColorAt(66)[2], 20);
}

TEST_F(EditModelTest, FillsTheHole) {
  request.mutable_remove()->set_fill(true);
  ASSERT_OK(Edit());
  EXPECT_GE(result.num_removed(), kNumOfSegment);
  EXPECT_GE(num_progress, 1);
  EXPECT_EQ(Model(kSecond).edit(),
            absl::StrCat("removed ", result.num_removed(), " Gaussians and filled the hole"));
  EXPECT_EQ(Model(kSecond).num_gaussians(),
            Model(kFirst).num_gaussians() - result.num_removed() + result.num_added());
  EXPECT_LT(ColorAt(30)[0], 20) << "nothing is around the square that could be continued";
}

// The squares are 2 units away, the focal length is that of the view.
TEST_F(EditModelTest, MovesACopyAndThenTheCopy) {
  auto& move = *request.mutable_move();
  move.mutable_translation()->set_y(-0.6);
  move.set_copy(true);
  ASSERT_OK(Edit());
  EXPECT_EQ(result.num_added(), kNumOfSegment);
  EXPECT_EQ(Model(kSecond).edit(), "copied 10000 Gaussians");
  const auto copy = Call(&SelectionStub::GetSelection, Named{result.selection()});
  ASSERT_OK(copy);
  EXPECT_EQ(copy->model(), kSecond);
  EXPECT_EQ(copy->num_gaussians(), kNumOfSegment);
  EXPECT_GT(ColorAt(30)[0], 100) << "the original stays";
  // The copy goes far away, and the original with it no more.
  request.mutable_subset()->set_selection(result.selection());
  move.set_copy(false);
  move.mutable_translation()->set_y(-50);
  ASSERT_OK(Edit());
  EXPECT_EQ(result.edited_from(), kSecond);
  EXPECT_EQ(result.num_changed(), kNumOfSegment);
  const auto moved = Call(&SelectionStub::GetSelection, Named{result.selection()});
  EXPECT_NEAR(moved->box().min().y(), copy->box().min().y() - 50, 1e-3);
  EXPECT_GT(ColorAt(30)[0], 100);
}

TEST_F(EditModelTest, TurnsAndScalesAboutTheMiddle) {
  auto& move = *request.mutable_move();
  move.mutable_rotation()->set_w(std::sqrt(0.5));
  move.mutable_rotation()->set_z(std::sqrt(0.5));
  move.set_scale(0.5);
  v1::CreateSelectionRequest all;
  all.set_model(kModel);
  *all.mutable_segment() = request.subset().segment();
  const auto before = Call(&SelectionStub::CreateSelection, all);
  ASSERT_OK(Edit());
  const auto after = Call(&SelectionStub::GetSelection, Named{result.selection()});
  const auto size = [](const v1::BoundingBox& box) {
    return Eigen::Vector3d(box.max().x() - box.min().x(), box.max().y() - box.min().y(),
                           box.max().z() - box.min().z());
  };
  const Eigen::Vector3d was = size(before->box()), is = size(after->box());
  EXPECT_NEAR(is.x(), was.y() / 2, 1e-3);
  EXPECT_NEAR(is.y(), was.x() / 2, 1e-3);
  EXPECT_NEAR(after->box().min().x() + after->box().max().x(),
              before->box().min().x() + before->box().max().x(), 1e-3);
}

TEST_F(EditModelTest, Recolours) {
  request.mutable_recolor()->set_green(0.8);
  ASSERT_OK(Edit());
  EXPECT_EQ(result.num_changed(), kNumOfSegment);
  EXPECT_EQ(Model(kSecond).edit(), "recoloured 10000 Gaussians");
  const std::vector<int> color = ColorAt(30);
  EXPECT_LT(color[0], 20);
  EXPECT_GT(color[1], 150);
  EXPECT_GT(ColorAt(66)[2], 100);
}

TEST_F(EditModelTest, EndsAGrowthThatIsRepeated) {
  request.mutable_move()->set_scale(1000);
  int num_done = 0;
  for (; num_done < 8; ++num_done) {
    if (!Edit().ok()) break;
    request.mutable_subset()->set_selection(result.selection());
  }
  EXPECT_GE(num_done, 2);
  EXPECT_LE(num_done, 4) << "beyond 1e9 scene units";
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move", "allowed are 1e+09");
  EXPECT_GT(ColorAt(66)[2], 100) << "the blue square is still drawn";
}

TEST_F(EditModelTest, RefusesWhatItCannotDo) {
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "edit", "one of");
  request.mutable_remove()->set_fill(true);
  request.mutable_subset()->set_complement(true);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "remove.fill", "complement");
  request.clear_subset();
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "subset", "required");
  SetSegment(1, 7, *request.mutable_subset());
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "subset.segment.id", "no segment");
  SetSegment(1, 1, *request.mutable_subset());
  request.mutable_move()->set_scale(5000);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move.scale", "0.001..1000");
  request.mutable_move()->set_scale(-1);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move.scale", "0.001..1000");
  request.mutable_move()->set_scale(1);
  request.mutable_move()->mutable_rotation()->set_w(2);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move.rotation", "norm");
  request.mutable_move()->clear_rotation();
  request.mutable_move()->mutable_pivot()->set_x(NAN);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move.pivot", "finite");
  request.mutable_move()->mutable_pivot()->set_x(0);
  // Float has no such number, or none that can be rendered: the model could not be loaded again.
  for (const double far : {2e9, 1e39, 1e300}) {
    request.mutable_move()->mutable_translation()->set_x(far);
    EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "move", "allowed are 1e+09");
  }
  request.mutable_recolor()->set_red(1.5);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "recolor.red", "0..1");
  request.mutable_recolor()->set_red(NAN);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "recolor.red", "0..1");
  // An empty selection.
  v1::CreateSelectionRequest none;
  none.set_model(kModel);
  none.mutable_gaussians()->set_bits(
      std::string(static_cast<size_t>((Model(kFirst).num_gaussians() + 7) / 8), '\0'));
  request.mutable_remove();
  request.mutable_subset()->set_selection(Call(&SelectionStub::CreateSelection, none)->name());
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "subset", "at least one");
  request.mutable_subset()->set_complement(true);
  EXPECT_ERROR(Edit(), grpc::INVALID_ARGUMENT, "subset", "some must stay");
  EXPECT_EQ(Live(), kFirst) << "nothing was made";
}

TEST_F(EditModelTest, RefusesASelectionOfAnotherModel) {
  request.mutable_recolor()->set_blue(1);
  ASSERT_OK(Edit());
  request.set_model(kFirst);
  request.mutable_subset()->set_selection(result.selection());
  EXPECT_ERROR(Edit(), grpc::FAILED_PRECONDITION, {.resource = kSecond});
}

TEST_F(EditModelTest, ACorrectionOfAnEditKeepsTheEdit) {
  request.mutable_remove();
  request.mutable_subset()->set_complement(true);
  ASSERT_OK(Edit());
  v1::CorrectSegmentRequest correct;
  correct.set_model(kModel);
  auto& correction = *correct.add_corrections();
  correction.mutable_view()->set_view("middle.jpg");
  std::vector<uint8_t> mask(size_t{kWidth} * kHeight);
  for (int y = 32; y < 47; ++y) std::fill_n(mask.begin() + y * kWidth + 15, 30, uint8_t{1});
  correction.mutable_mask()->mutable_rle()->set_width(kWidth);
  correction.mutable_mask()->mutable_rle()->set_height(kHeight);
  correction.mutable_mask()->mutable_rle()->set_counts(EncodeCocoRle({mask}, kWidth, kHeight));
  const auto corrected = Call(&SegmentationStub::CorrectSegment, correct);
  ASSERT_OK(corrected);
  const v1::Model model = Model(corrected->model());
  EXPECT_EQ(model.corrected_from(), kSecond);
  EXPECT_EQ(model.edited_from() + model.edit(), "");
  EXPECT_EQ(model.num_gaussians(), kNumOfSegment);
}

TEST_F(EditModelTest, CancelledEditsMakeNoModel) {
  request.mutable_remove()->set_fill(true);
  grpc::ClientContext context;
  const auto stream = running.edits->EditModel(&context, request);
  v1::EditModelResponse part;
  ASSERT_TRUE(stream->Read(&part));
  EXPECT_TRUE(part.has_progress());
  context.TryCancel();
  while (stream->Read(&part)) {
  }
  EXPECT_ERROR(stream->Finish(), grpc::CANCELLED);
  EXPECT_EQ(Live(), kFirst);
  // The memory is free again, and the pool.
  ASSERT_OK(Edit());
}

}  // namespace
}  // namespace pepeseg
