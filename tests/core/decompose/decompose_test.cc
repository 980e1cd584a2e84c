#include "core/decompose/decompose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/core/decompose/nested_parts.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::NestedParts;

// Decomposes a model without views, for which no blend rows may be rendered.
absl::StatusOr<Decomposition> DecomposeWithoutViews(const Model& model,
                                                    const std::vector<double>& scales) {
  const auto backend = MakeCpuBackend(2);
  return Decompose(*backend, model, scales, [](const ModelView&, std::span<const int32_t>) {
    return absl::InternalError("unexpected request for rows");
  });
}

TEST(Decompose, FindsPartsInsideGroups) {
  const NestedParts nested = testing::MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(nested.model, {0.01, 1}));
  ASSERT_EQ(whole.levels.size(), 2u);
  const Decomposition::Level &parts = whole.levels[0], &groups = whole.levels[1];
  ASSERT_EQ(parts.segments.size(), 4u);
  ASSERT_EQ(groups.segments.size(), 2u);
  for (size_t i = 0; i < nested.part.size(); ++i) {  // largest first: part 0 is segment 1
    EXPECT_EQ(parts.ids[i], nested.part[i] + 1);
    EXPECT_EQ(groups.ids[i], nested.part[i] < 0 ? 0 : nested.part[i] / 2 + 1);
  }
  for (int part = 0; part < 4; ++part) {
    EXPECT_EQ(parts.segments[part].parent, part / 2 + 1);
    EXPECT_EQ(parts.segments[part].num_gaussians, NestedParts::kSizes[part]);
  }
  EXPECT_EQ(groups.segments[0].num_gaussians, 70);
  EXPECT_EQ(groups.segments[0].parent, 0);
}

TEST(Decompose, BoundsTheMeansOfEachSegment) {
  const NestedParts nested = testing::MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(nested.model, {0.01, 1}));
  const Decomposition::Segment& second = whole.levels[0].segments[1];
  EXPECT_EQ(second.min, (std::array<float, 3>{1, 40, 0}));
  EXPECT_EQ(second.max, (std::array<float, 3>{1, 69, 0}));
  const Decomposition::Segment& group = whole.levels[1].segments[0];
  EXPECT_EQ(group.min, (std::array<float, 3>{0, 0, 0}));
  EXPECT_EQ(group.max, (std::array<float, 3>{1, 69, 0}));
}

TEST(Decompose, RequiresALargerCosineOfGaussiansThatViewsHardlyShow) {
  NestedParts nested = testing::MakeNestedParts();
  Model& model = nested.model;
  const int64_t lone = model.gaussians.count - 1;
  std::vector<int64_t> rows(model.gaussians.count);
  std::iota(rows.begin(), rows.end(), 0);
  rows.push_back(lone);  // a second Gaussian that is similar to no other
  model.gaussians = model.gaussians.Select(rows);
  model.field.features.resize(32 * rows.size());
  for (const int64_t row : {lone, lone + 1}) {  // both now have a cosine of 0.65 with part 0
    float* feature = &model.field.features[32 * row];
    std::copy_n(model.field.features.data(), 32, feature);
    feature[20] = 1.96f;
  }
  ModelView view;
  view.camera = {1, 1, 1, 1, 0.5, 0.5};
  model.views = {view};
  const auto all_but_the_last = [&](const ModelView&, std::span<const int32_t> pixels) {
    EXPECT_EQ(pixels.size(), 1u);
    PixelRows shown;
    shown.first = {0, static_cast<int32_t>(lone) + 1};
    for (int32_t i = 0; i <= lone; ++i) shown.gaussian.push_back(i);
    shown.weight.assign(shown.gaussian.size(), 0.01f);
    return absl::StatusOr<PixelRows>(shown);
  };
  const auto backend = MakeCpuBackend(2);
  ASSERT_OK_AND_ASSIGN(const Decomposition whole,
                       Decompose(*backend, model, std::vector<double>{0.01}, all_but_the_last));
  EXPECT_EQ(whole.levels[0].ids[lone], 1);
  EXPECT_EQ(whole.levels[0].ids[lone + 1], 0);
}

TEST(Decompose, ReturnsErrorsOfTheRows) {
  NestedParts nested = testing::MakeNestedParts();
  ModelView view;
  view.camera = {1, 1, 1, 1, 0.5, 0.5};
  nested.model.views = {view};
  EXPECT_STATUS(DecomposeWithoutViews(nested.model, {0.5}), absl::StatusCode::kInternal,
                "unexpected request for rows");
}

TEST(Decompose, GivesTheSameLevelForAScaleAlone) {
  const NestedParts nested = testing::MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition both, DecomposeWithoutViews(nested.model, {0.01, 1}));
  ASSERT_OK_AND_ASSIGN(const Decomposition one, DecomposeWithoutViews(nested.model, {1}));
  ASSERT_EQ(one.levels.size(), 1u);
  EXPECT_EQ(one.levels[0].ids, both.levels[1].ids);
}

TEST(Decompose, LeavesTooFewGaussiansForAPieceInNoSegment) {
  Model model = testing::MakeNestedParts().model;
  const std::vector<int64_t> rows = {0, 1, 2, 3, 4};
  model.gaussians = model.gaussians.Select(rows);
  model.field.features.resize(32 * rows.size());
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(model, {0.5}));
  EXPECT_TRUE(whole.levels[0].segments.empty());
  EXPECT_EQ(whole.levels[0].ids, std::vector<int32_t>(5));
}

TEST(Decompose, RefusesBadScales) {
  const Model model = testing::MakeNestedParts().model;
  const auto expect_refused = [&](const std::vector<double>& scales, const std::string& words) {
    EXPECT_STATUS(DecomposeWithoutViews(model, scales), absl::StatusCode::kInvalidArgument, words);
  };
  expect_refused({}, "0 scales, must be 1 to 8");
  expect_refused(std::vector<double>(9, 0.5), "9 scales");
  expect_refused({0.5, 1.5}, "scale 1 is 1.5, must be in [0, 1]");
  expect_refused({NAN}, "scale 0 is nan");
  expect_refused({0.5, 0.5}, "scale 1 is 0.5, must be over the one before, 0.5");
}

TEST(MembersOf, ReturnsTheGaussiansOfASegment) {
  const NestedParts nested = testing::MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(nested.model, {0.01, 1}));
  ASSERT_OK_AND_ASSIGN(const GaussianSet members, MembersOf(whole, 0, 3));
  EXPECT_EQ(members.count(), NestedParts::kSizes[2]);
  for (size_t i = 0; i < nested.part.size(); ++i) {
    EXPECT_EQ(members.member[i], nested.part[i] == 2 ? 1 : 0);
  }
  EXPECT_STATUS(MembersOf(whole, 2, 1), absl::StatusCode::kInvalidArgument,
                "level is 2, must be in [0, 1]");
  EXPECT_STATUS(MembersOf(whole, -1, 1), absl::StatusCode::kInvalidArgument, "level is -1");
  EXPECT_STATUS(MembersOf(whole, 1, 3), absl::StatusCode::kInvalidArgument,
                "segment is 3, level 1 has 2 segments");
  EXPECT_STATUS(MembersOf(whole, 1, 0), absl::StatusCode::kInvalidArgument, "segment is 0");
}

TEST(LevelOfPieces, NumbersSegmentsBySizeThenByPiece) {
  const Gaussians gaussians = Gaussians::Zero(7, 0);
  const std::vector<int32_t> pieces = {3, 0, 1, -1, 3, 1, 3};
  const Decomposition::Level level = LevelOfPieces(0.5, pieces, gaussians);
  EXPECT_EQ(level.ids, (std::vector<int32_t>{1, 3, 2, 0, 1, 2, 1}));
  EXPECT_EQ(level.segments.size(), 3u) << "piece 2 has no Gaussian";
}

}  // namespace
}  // namespace pepeseg
