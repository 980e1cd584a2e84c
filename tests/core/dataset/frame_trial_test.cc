#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/dataset/pixel_frame.h"
#include "core/formats/images.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr double kMuchMore = 1.3;

// A photograph of the shelf with its hand-made labels, both upright.
struct LabelledPhotograph {
  std::string name;
  Image photo;
  FloatImage labels;
};

std::vector<LabelledPhotograph> Shelf() {
  const fs::path shelf = fs::path(PEPESEG_TEST_DATA) / "apc_shelf";
  std::vector<LabelledPhotograph> all;
  for (const auto& entry : fs::directory_iterator(shelf / "labels")) {
    const std::string stem = entry.path().stem().string();
    const auto photo = DecodePhoto(shelf / "images" / (stem + ".jpg"), stem);
    const auto labels = DecodeGrey(entry.path(), stem);
    if (photo.ok() && labels.ok()) all.push_back({stem, *photo, *labels});
  }
  return all;
}

void AddTo(FrameTrial& trial, const LabelledPhotograph& shelf, int orientation, PixelFrame frame) {
  const int undo = InverseOrientation(orientation);
  trial.Add(Upright(shelf.photo, undo), orientation,
            frame == PixelFrame::kUpright ? shelf.labels : Turned(shelf.labels, undo));
}

// Orientations 2 to 4 leave the shape as it is.
TEST(FrameTrial, FindsTheFrameOfLabelsOfRealPhotographs) {
  const std::vector<LabelledPhotograph> all = Shelf();
  ASSERT_GE(all.size(), 2u);
  for (const PixelFrame frame : {PixelFrame::kStored, PixelFrame::kUpright}) {
    for (int orientation = 2; orientation <= 4; ++orientation) {
      FrameTrial together(FrameTrial::Values::kLabels);
      for (const LabelledPhotograph& shelf : all) {
        AddTo(together, shelf, orientation, frame);
        FrameTrial alone(FrameTrial::Values::kLabels);
        AddTo(alone, shelf, orientation, frame);
        EXPECT_EQ(alone.Verdict(kMuchMore), frame) << shelf.name << " " << orientation;
      }
      EXPECT_FALSE(together.NeedsNoChoice());
      EXPECT_EQ(together.Verdict(kMuchMore), frame) << orientation;
    }
  }
}

// One thing of one photograph has few borders. The wrong frame must not fit it much better.
TEST(FrameTrial, RarelyTakesOneThingForOneOfTheOtherFrame) {
  int num = 0, num_right = 0, num_wrong = 0;
  for (const LabelledPhotograph& shelf : Shelf()) {
    for (const float id : std::set<float>(shelf.labels.values.begin(), shelf.labels.values.end())) {
      if (id == 0) continue;
      LabelledPhotograph one = shelf;
      for (float& value : one.labels.values) value = value == id ? 1.0F : 0.0F;
      for (int orientation = 2; orientation <= 4; ++orientation) {
        FrameTrial trial(FrameTrial::Values::kLabels);
        AddTo(trial, one, orientation, PixelFrame::kUpright);
        if (trial.NeedsNoChoice()) continue;
        const auto verdict = trial.Verdict(kMuchMore);
        ++num;
        num_right += verdict == PixelFrame::kUpright ? 1 : 0;
        num_wrong += verdict == PixelFrame::kStored ? 1 : 0;
      }
    }
  }
  EXPECT_GE(num, 20);
  EXPECT_EQ(num_wrong, 0);
  EXPECT_GE(num_right, num / 2);
}

}  // namespace
}  // namespace pepeseg
