#include "core/evaluate/labeled_view.h"

#include <gtest/gtest.h>

#include "core/evaluate/segmentation_metrics.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Returns a view of 4x2 pixels with these labels.
LabeledView Labeled(const std::string& name, std::vector<uint16_t> labels) {
  LabeledView labeled;
  labeled.view.name = name;
  labeled.view.camera = {4, 2, 4, 4, 2, 1};
  labeled.labels = std::move(labels);
  return labeled;
}

TEST(FindEntities, TakesTheViewsByNameThatShowEnough) {
  std::vector<LabeledView> views = {Labeled("c", {1, 1, 1, 0, 7, 7, 7, 7}),
                                    Labeled("a", {1, 1, 0, 0, 0, 0, 300, 300}),
                                    Labeled("b", {1, 1, 1, 7, 7, 7, 0, 300})};
  views[1].ignore = {0, 0, 0, 0, 0, 0, 0, 1};
  const auto entities = FindEntities(views, 3);
  ASSERT_EQ(entities.size(), 3u);
  EXPECT_EQ(entities[0].id, 1);
  EXPECT_EQ(entities[0].views, (std::vector<const LabeledView*>{&views[2], &views[0]}));
  EXPECT_EQ(entities[0].num_pixels, (std::vector<int64_t>{3, 3}));
  EXPECT_EQ(entities[1].id, 7);
  EXPECT_EQ(entities[1].num_pixels, (std::vector<int64_t>{3, 4}));
  EXPECT_EQ(entities[2].id, 300);
  EXPECT_TRUE(entities[2].views.empty());
  // An ignored pixel shows nothing.
  EXPECT_EQ(FindEntities(views, 2)[2].views.size(), 0u);
  EXPECT_EQ(FindEntities(views, 1)[2].num_pixels, (std::vector<int64_t>{1, 1}));
  EXPECT_EQ(views[1].MaskOf(300), (std::vector<uint8_t>{0, 0, 0, 0, 0, 0, 1, 0}));
}

TEST(CheckLabeledViews, NamesTheViewThatDoesNotFit) {
  const LabeledView good = Labeled("a", std::vector<uint16_t>(8));
  LabeledView other = Labeled("b", std::vector<uint16_t>(8));
  EXPECT_OK(CheckLabeledViews(std::vector{good, other}));
  other.ignore.resize(7);
  EXPECT_STATUS(CheckLabeledViews(std::vector{good, other}), absl::StatusCode::kInvalidArgument,
                "view b: 8 labels and 7 ignore values; it has 8 pixels");
  EXPECT_STATUS(CheckLabeledViews(std::vector{Labeled("c", std::vector<uint16_t>(9))}),
                absl::StatusCode::kInvalidArgument, "view c: 9 labels");
  EXPECT_STATUS(CheckLabeledViews(std::vector{good, good}), absl::StatusCode::kInvalidArgument,
                "view a has labels twice");
}

TEST(IouByThreshold, MatchesHandCountedMasks) {
  const LabeledView view = Labeled("a", {5, 5, 5, 5, 0, 0, 9, 9});
  const std::vector<float> similarity = {0.9f, 0.8f, 0.6f, 0.1f, 0.85f, -1, 0.6f, 0.2f};
  const std::vector<double> thresholds = {-2, 0.5, 0.7, 0.82, 0.95};
  // Pixels over each threshold, inside and outside the entity: 4 and 4, 3 and 2, 2 and 1, 1 and 1,
  // none.
  EXPECT_EQ(IouByThreshold(similarity, view, 5, thresholds),
            (std::vector<double>{4.0 / 8, 3.0 / 6, 2.0 / 5, 1.0 / 5, 0}));
}

TEST(IouByThreshold, IsStrictAndInSinglePrecisionAsSegmentIs) {
  const LabeledView view = Labeled("a", {5, 5, 5, 5, 0, 0, 0, 0});
  const std::vector<float> similarity(8, 0.7f);
  EXPECT_EQ(IouByThreshold(similarity, view, 5, std::vector{0.7}), std::vector{0.0});
  EXPECT_EQ(IouByThreshold(similarity, view, 5, std::vector{0.699}), std::vector{0.5});
}

TEST(IouByThreshold, LeavesOutIgnoredPixels) {
  LabeledView view = Labeled("a", {5, 5, 5, 5, 0, 0, 9, 9});
  view.ignore = {0, 0, 0, 1, 1, 1, 1, 1};
  const std::vector<float> similarity = {0.9f, 0.8f, 0.6f, 0.9f, 0.9f, 0.9f, 0.9f, 0.9f};
  EXPECT_EQ(IouByThreshold(similarity, view, 5, std::vector{0.7, 0.95}),
            (std::vector<double>{2.0 / 3, 0}));
  view.ignore.assign(8, 1);
  EXPECT_EQ(IouByThreshold(similarity, view, 5, std::vector{0.7}), std::vector{1.0});
}

}  // namespace
}  // namespace pepeseg
