#include "core/evaluate/truth_view.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Returns a view of 4x2 pixels.
ModelView MiniatureView() {
  ModelView view;
  view.name = "a";
  view.camera = {4, 2, 4, 4, 2, 1};
  return view;
}

TEST(TruthViewBuilder, KeepsMasksThatOverlapAndEqualMasks) {
  TruthViewBuilder builder(MiniatureView());
  const std::vector<uint8_t> cup = {1, 1, 1, 1, 0, 0, 0, 0}, handle = {0, 0, 0, 255, 0, 0, 0, 0};
  ASSERT_OK(builder.AddMask("cup", cup));
  ASSERT_OK(builder.AddMask("handle", handle));
  ASSERT_OK(builder.AddMask("mug", cup));
  ASSERT_OK(builder.AddMask("hidden", std::vector<uint8_t>(8)));
  ASSERT_OK(builder.AddIgnore(std::vector<uint8_t>{1, 0, 0, 0, 0, 0, 0, 0}));
  const TruthView truth = std::move(builder).Build();
  EXPECT_EQ(truth.entities, (std::vector<std::string>{"cup", "handle", "mug"}));
  EXPECT_EQ(truth.MaskOf("cup"), cup);
  EXPECT_EQ(truth.MaskOf("mug"), cup);
  EXPECT_EQ(truth.MaskOf("handle"), (std::vector<uint8_t>{0, 0, 0, 1, 0, 0, 0, 0}));
  EXPECT_EQ(truth.CountedMaskOf("cup"), (std::vector<uint8_t>{0, 1, 1, 1, 0, 0, 0, 0}));
  EXPECT_FALSE(truth.IndexOf("hidden"));
  EXPECT_TRUE(truth.MaskOf("hidden").empty());
}

TEST(TruthViewBuilder, TakesLabelImagesWithAndWithoutNames) {
  TruthViewBuilder builder(MiniatureView());
  const std::vector<uint16_t> labels = {0, 3, 3, 0, 700, 0, 0, 3};
  ASSERT_OK(builder.AddLabels(labels, {{700, "mug 2"}, {9, "unused"}}));
  const TruthView truth = std::move(builder).Build();
  EXPECT_EQ(truth.entities, (std::vector<std::string>{"3", "mug 2"}));
  EXPECT_EQ(truth.MaskOf("3"), (std::vector<uint8_t>{0, 1, 1, 0, 0, 0, 0, 1}));
  EXPECT_EQ(truth.MaskOf("mug 2"), (std::vector<uint8_t>{0, 0, 0, 0, 1, 0, 0, 0}));
}

TEST(TruthViewBuilder, PutsVoidPixelsIntoNoEntityAndIgnoresThem) {
  TruthViewBuilder builder(MiniatureView());
  const std::vector<uint16_t> labels = {0, 3, 255, 0, 7, 255, 255, 3};
  ASSERT_OK(builder.AddLabels(labels, {}, 255));
  ASSERT_OK(builder.AddIgnore(std::vector<uint8_t>{0, 1, 1, 0, 0, 0, 0, 0}));
  const TruthView truth = std::move(builder).Build();
  EXPECT_EQ(truth.entities, (std::vector<std::string>{"3", "7"}));
  EXPECT_EQ(truth.MaskOf("3"), (std::vector<uint8_t>{0, 1, 0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(truth.ignore, (std::vector<uint8_t>{0, 1, 1, 0, 0, 1, 1, 0}));
  EXPECT_EQ(truth.num_void, 3);
}

TEST(TruthViewBuilder, IgnoresNothingWhereNoPixelHasTheVoidLabel) {
  TruthViewBuilder builder(MiniatureView());
  ASSERT_OK(builder.AddLabels(std::vector<uint16_t>{0, 3, 255, 0, 0, 0, 0, 3}, {}, 9));
  const TruthView truth = std::move(builder).Build();
  EXPECT_EQ(truth.entities, (std::vector<std::string>{"3", "255"}));
  EXPECT_TRUE(truth.ignore.empty());
  EXPECT_EQ(truth.num_void, 0);
}

TEST(VoidLabel, IsTheLargestNextToAnother) {
  EXPECT_EQ(VoidLabelOf(std::vector<uint16_t>{0, 3, 255}), 255);
  EXPECT_EQ(VoidLabelOf(std::vector<uint16_t>{255, 254}), 255);
  EXPECT_FALSE(VoidLabelOf(std::vector<uint16_t>{0, 255, 255})) << "a binary mask";
  EXPECT_FALSE(VoidLabelOf(std::vector<uint16_t>{0, 3, 255, 256})) << "ids of 16 bits";
  EXPECT_FALSE(VoidLabelOf(std::vector<uint16_t>{0, 3, 7}));
  EXPECT_FALSE(VoidLabelOf({}));
}

TEST(VoidLabel, MayBeTheLargestOfSixteenBits) {
  EXPECT_EQ(VoidLabelOf(std::vector<uint16_t>{0, 3, 65535, 300}), 65535);
  EXPECT_FALSE(VoidLabelOf(std::vector<uint16_t>{0, 65535})) << "a binary mask";
  EXPECT_FALSE(VoidLabelOf(std::vector<uint16_t>{0, 65535, 40000})) << "ids up to the end";
}

TEST(TruthViewBuilder, NamesViewAndEntityOfWhatDoesNotFit) {
  TruthViewBuilder builder(MiniatureView());
  EXPECT_STATUS(builder.AddMask("cup", std::vector<uint8_t>(7)), absl::StatusCode::kInvalidArgument,
                "view \"a\": the mask of entity \"cup\" has 7 pixels, must have 4x2");
  EXPECT_STATUS(builder.AddLabels(std::vector<uint16_t>(9), {}), absl::StatusCode::kInvalidArgument,
                "view \"a\": the label image has 9 pixels");
  EXPECT_STATUS(builder.AddIgnore(std::vector<uint8_t>(1)), absl::StatusCode::kInvalidArgument,
                "view \"a\": the ignore mask has 1 pixels");
  const std::vector<uint8_t> all(8, 1);
  EXPECT_STATUS(builder.AddMask("", all), absl::StatusCode::kInvalidArgument,
                "view \"a\": an entity has no name");
  ASSERT_OK(builder.AddMask("cup", all));
  EXPECT_STATUS(builder.AddMask("cup", all), absl::StatusCode::kInvalidArgument,
                "view \"a\": entity \"cup\" has a mask already");
}

TEST(CategoryOf, IsTheNameWithoutItsNumber) {
  for (const char* name : {"mug", "mug.2", "mug 2", "mug_17", "mug-2", "mug. 2"}) {
    EXPECT_EQ(CategoryOf(name), "mug") << name;
  }
  EXPECT_EQ(CategoryOf("green apple 3"), "green apple");
  for (const char* name : {"area51", "7", ".2", "mug.", "mug.2b", ""}) {
    EXPECT_EQ(CategoryOf(name), name);
  }
}

}  // namespace
}  // namespace pepeseg
