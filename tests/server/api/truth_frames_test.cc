#include "server/api/truth_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"
#include "server/api/evaluation_views.h"
#include "tests/testing/png_bytes.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kSide = 120, kShort = 80;  // size of the upright photographs
constexpr uint8_t kCup = 5, kBox = 9;

absl::Status StillWanted() { return absl::OkStatus(); }

// Values of an image, [height, width].
struct Values {
  int width, height;
  std::vector<uint8_t> values;

  Values TurnedBy(int orientation) const {
    const bool transposed = orientation >= 5;
    return {transposed ? height : width, transposed ? width : height,
            pepeseg::Turned(values, width, height, orientation)};
  }
  std::string Png() const {
    std::string rows;
    for (size_t i = 0; i < values.size(); ++i) {
      if (i % width == 0) rows += '\0';
      rows += static_cast<char>(values[i]);
    }
    return testing::GreyPng(width, height, 8, rows);
  }
  Values MaskOf(uint8_t id) const {
    Values mask = *this;
    for (uint8_t& value : mask.values) value = value == id ? 255 : 0;
    return mask;
  }
};

// Two things, neither of which is where it would be if the photograph was turned or mirrored.
Values Labels(int width = kSide, int height = kShort) {
  Values labels{width, height, std::vector<uint8_t>(static_cast<size_t>(width) * height)};
  const auto fill = [&](int x, int y, int right, int bottom, uint8_t id) {
    for (int row = y; row < bottom; ++row) {
      std::fill_n(labels.values.begin() + row * width + x, right - x, id);
    }
  };
  fill(8, 6, 38, 30, kCup);
  fill(50, 14, 64, 50, kBox);
  return labels;
}

// Photographs of these things.
class FakePhotographs final : public ViewPhotographs {
 public:
  int Orientation(const ModelView&) override { return orientation; }
  absl::StatusOr<Image> Upright(const ModelView& view, int max_side) override {
    ++num_read;
    if (is_gone) return absl::NotFoundError("gone");
    const Values labels = Labels(view.camera.width, view.camera.height);
    Image image{labels.width, labels.height, 3, {}};
    for (const uint8_t id : labels.values) {
      const uint8_t grey = is_flat ? 90 : static_cast<uint8_t>(40 + 20 * id);
      image.pixels.insert(image.pixels.end(), 3, grey);
    }
    return ShrunkTo(image, max_side);
  }

  int orientation = 1;
  bool is_gone = false, is_flat = false;
  int num_read = 0;
};

struct TruthFramesTest : ::testing::Test {
  explicit TruthFramesTest(int width = kSide, int height = kShort) {
    for (const char* name : {"a.jpg", "b.jpg"}) {
      ModelView& view = model.views.emplace_back();
      view.name = name;
      view.camera = {width, height, 100, 100, 50, 50};
      view.held_out = true;
      view.photograph = Photograph{{LensModel::kPinhole, width, height, 100, 100, 50, 50, {}}};
      view.photograph->width = width;
      view.photograph->height = height;
    }
  }
  // A request with the label images of both views as they are in the stored pixels.
  v1::EvaluateModelRequest Stored() const {
    const int undo = InverseOrientation(photographs.orientation);
    return Request(
        Labels(model.views[0].camera.width, model.views[0].camera.height).TurnedBy(undo));
  }
  static v1::EvaluateModelRequest Request(const Values& labels) {
    v1::EvaluateModelRequest request;
    for (const char* name : {"a.jpg", "b.jpg"}) {
      v1::ViewTruth& truth = *request.add_views();
      truth.set_view(name);
      truth.set_labels_png(labels.Png());
    }
    return request;
  }
  // Expects that the truth is read as it is in the upright photographs.
  void ExpectUpright(const v1::EvaluateModelRequest& request) {
    ASSERT_OK_AND_ASSIGN(const TruthFrames frames,
                         TruthFrames::Choose(request, model, photographs, StillWanted));
    notes = frames.Notes();
    ASSERT_OK_AND_ASSIGN(const auto views, ReadTruthViews(request, model, StillWanted, frames));
    const Values labels = Labels(model.views[0].camera.width, model.views[0].camera.height);
    ASSERT_EQ(views.size(), 2u);
    for (const TruthView& view : views) {
      for (const auto& [name, id] : {std::pair("5", kCup), {"9", kBox}}) {
        std::vector<uint8_t> mask = labels.MaskOf(id).values;
        for (uint8_t& value : mask) value = value != 0 ? 1 : 0;
        EXPECT_EQ(view.MaskOf(name), mask) << photographs.orientation << " " << name;
      }
    }
  }

  Model model;
  FakePhotographs photographs;
  std::vector<std::string> notes;
};
struct SquareTruthFramesTest : TruthFramesTest {
  SquareTruthFramesTest() : TruthFramesTest(kSide, kSide) {}
};

TEST_F(TruthFramesTest, TurnsLabelsOfTheStoredPixels) {
  for (int orientation = 2; orientation <= 8; ++orientation) {
    photographs.orientation = orientation;
    ExpectUpright(Stored());
    EXPECT_THAT(notes, ElementsAre(HasSubstr("the truth of 2 views"))) << orientation;
    EXPECT_THAT(notes[0], HasSubstr("a.jpg, b.jpg"));
  }
}

TEST_F(SquareTruthFramesTest, TurnsLabelsOfTheStoredPixels) {
  for (int orientation = 2; orientation <= 8; ++orientation) {
    photographs.orientation = orientation;
    ExpectUpright(Stored());
    EXPECT_EQ(notes.size(), 1u) << orientation;
  }
}

TEST_F(TruthFramesTest, LeavesUprightLabelsAsTheyAre) {
  for (int orientation = 1; orientation <= 8; ++orientation) {
    photographs.orientation = orientation;
    ExpectUpright(Request(Labels()));
    EXPECT_THAT(notes, IsEmpty()) << orientation;
  }
}

// Sizes decide alone where they can, so that no photograph is read.
TEST_F(TruthFramesTest, ReadsPhotographsOnlyWhereSizesDoNotDecide) {
  for (const int orientation : {1, 6, 8}) {
    photographs.orientation = orientation;
    ExpectUpright(Stored());
  }
  EXPECT_EQ(photographs.num_read, 0);
}

TEST_F(TruthFramesTest, TakesTheTruthAsUprightIfNothingDecides) {
  photographs.orientation = 3;
  const auto read = [&]() -> std::vector<uint8_t> {
    const auto frames = TruthFrames::Choose(Stored(), model, photographs, StillWanted);
    EXPECT_OK(frames);
    EXPECT_THAT(frames->Notes(), IsEmpty());
    const auto views = ReadTruthViews(Stored(), model, StillWanted, *frames);
    EXPECT_OK(views);
    return views->front().MaskOf("5");
  };
  std::vector<uint8_t> as_given = Labels().TurnedBy(3).MaskOf(kCup).values;
  for (uint8_t& value : as_given) value = value != 0 ? 1 : 0;
  photographs.is_flat = true;
  EXPECT_EQ(read(), as_given);
  photographs.is_gone = true;
  EXPECT_EQ(read(), as_given);
}

TEST_F(TruthFramesTest, RefusesTransposedLabelsOfUnknownOrientation) {
  photographs.orientation = 6;
  const auto request = Stored();
  photographs.orientation = 1;
  ASSERT_OK_AND_ASSIGN(const TruthFrames frames,
                       TruthFrames::Choose(request, model, photographs, StillWanted));
  EXPECT_STATUS(ReadTruthViews(request, model, StillWanted, frames),
                absl::StatusCode::kInvalidArgument, "upright photograph");
}

TEST_F(TruthFramesTest, TurnsMasksAndWhatIsIgnored) {
  photographs.orientation = 3;
  const Values labels = Labels().TurnedBy(3);
  v1::EvaluateModelRequest request;
  for (const char* name : {"a.jpg", "b.jpg"}) {
    v1::ViewTruth& truth = *request.add_views();
    truth.set_view(name);
    for (const auto& [entity, id] : {std::pair("5", kCup), {"9", kBox}}) {
      v1::EntityMask& mask = *truth.add_masks();
      mask.set_entity(entity);
      const Values values = labels.MaskOf(id);
      if (id == kCup) {
        mask.mutable_mask()->set_png(values.Png());
        continue;
      }
      BinaryMask binary{values.values};
      for (uint8_t& value : binary.pixels) value = value != 0 ? 1 : 0;
      *mask.mutable_mask()->mutable_rle() = RleToProto(binary, values.width, values.height);
    }
    // A corner, whose borders follow nothing: it is of the frame of the truth.
    Values corner{kSide, kShort, std::vector<uint8_t>(kSide * kShort)};
    for (int y = 0; y < 20; ++y) std::fill_n(corner.values.begin() + y * kSide, 40, 1);
    truth.set_ignore_png(corner.Png());
  }
  ExpectUpright(request);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("the truth of 2"), HasSubstr("the ignore masks of 2")));
  ASSERT_OK_AND_ASSIGN(const TruthFrames frames,
                       TruthFrames::Choose(request, model, photographs, StillWanted));
  ASSERT_OK_AND_ASSIGN(const auto views, ReadTruthViews(request, model, StillWanted, frames));
  EXPECT_EQ(views[0].ignore.front(), 0);
  EXPECT_EQ(views[0].ignore.back(), 1) << "the corner is at the bottom right when upright";
}

TEST_F(TruthFramesTest, TurnsMasksOfSam) {
  photographs.orientation = 2;
  v1::EvaluateModelRequest request;
  v1::SamViewMasks& sam = *request.add_sam_views();
  sam.set_view("a.jpg");
  sam.add_masks()->mutable_mask()->set_png(Labels().MaskOf(kCup).TurnedBy(2).Png());
  ASSERT_OK_AND_ASSIGN(const TruthFrames frames,
                       TruthFrames::Choose(request, model, photographs, StillWanted));
  EXPECT_EQ(frames.Notes().size(), 1u);
  ASSERT_OK_AND_ASSIGN(const auto views, ReadSamViews(request, model, StillWanted, frames));
  ASSERT_EQ(views[0].masks.num_masks, 1);
  EXPECT_TRUE(views[0].masks.Covers(0, 10, 10));
  EXPECT_FALSE(views[0].masks.Covers(0, kSide - 11, 10));
}

TEST_F(TruthFramesTest, LeavesImagesOfTheViewAsTheyAre) {
  photographs.orientation = 3;
  v1::EvaluateModelRequest request = Stored();
  request.set_frame(v1::PIXEL_FRAME_VIEW);
  ASSERT_OK_AND_ASSIGN(const TruthFrames frames,
                       TruthFrames::Choose(request, model, photographs, StillWanted));
  EXPECT_THAT(frames.Notes(), IsEmpty());
  EXPECT_EQ(photographs.num_read, 0);
}

TEST_F(TruthFramesTest, EndsWhenTheClientIsGone) {
  photographs.orientation = 3;
  for (int last = 1; last < 6; ++last) {
    int calls = 0;
    const auto frames = TruthFrames::Choose(Stored(), model, photographs, [&] {
      return ++calls >= last ? absl::CancelledError("gone") : absl::OkStatus();
    });
    EXPECT_TRUE(absl::IsCancelled(frames.status())) << last;
  }
}

}  // namespace
}  // namespace pepeseg
