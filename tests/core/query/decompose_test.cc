#include "core/query/decompose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// A model without views: parts 0 and 1 form group 0, parts 2 and 3 form group 1. At small scales
// the features of the parts are far apart, at large scales those of a group are the same. The last
// Gaussian is similar to no other.
struct NestedParts {
  static constexpr std::array<int, 4> kSizes = {40, 30, 20, 12};
  Model model;
  std::vector<int> part;  // [num_gaussians]; -1 for the last one
};

constexpr int kFirstPartChannel = 2, kLoneChannel = 20;

void SetFeature(std::vector<float>& features, size_t row, int part, std::mt19937& random) {
  float* feature = &features[32 * row];
  if (part < 0) {
    feature[kLoneChannel] = 1;
    return;
  }
  // The noise is small compared with the differences between parts.
  for (int k = 0; k < 8; ++k) feature[k] = 0.01f * static_cast<float>(random() % 100) / 100;
  feature[part / 2] += 0.6f;
  feature[kFirstPartChannel + part] += 0.8f;
}

NestedParts MakeNestedParts() {
  NestedParts nested;
  for (int part = 0; part < 4; ++part) {
    nested.part.insert(nested.part.end(), NestedParts::kSizes[part], part);
  }
  nested.part.push_back(-1);
  const size_t count = nested.part.size();
  Model& model = nested.model;
  model.gaussians = Gaussians::Zero(static_cast<int64_t>(count), 0);
  model.field.features.assign(32 * count, 0.0f);
  model.field.scale_quantiles = {1, 3};
  // The gate of the part channels falls from 0.98 at scale 0 to 0.02 at scale 1.
  for (int part = 0; part < 4; ++part) {
    model.field.gate[kFirstPartChannel + part] = -8;
    model.field.gate[32 + kFirstPartChannel + part] = 4;
  }
  std::mt19937 random(4);
  for (size_t i = 0; i < count; ++i) {
    model.gaussians.Plane(kMeanPlane)[i] = static_cast<float>(nested.part[i]);
    model.gaussians.Plane(kMeanPlane + 1)[i] = static_cast<float>(i);
    SetFeature(model.field.features, i, nested.part[i], random);
  }
  return nested;
}

// Decomposes a model without views, for which no blend rows may be rendered.
absl::StatusOr<Decomposition> DecomposeWithoutViews(const Model& model,
                                                    const std::vector<double>& scales) {
  const auto backend = MakeCpuBackend(2);
  return Decompose(*backend, model, scales, [](const ModelView&, std::span<const int32_t>) {
    return absl::InternalError("unexpected request for rows");
  });
}

TEST(Decompose, FindsPartsInsideGroups) {
  const NestedParts nested = MakeNestedParts();
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
  const NestedParts nested = MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(nested.model, {0.01, 1}));
  const Decomposition::Segment& second = whole.levels[0].segments[1];
  EXPECT_EQ(second.min, (std::array<float, 3>{1, 40, 0}));
  EXPECT_EQ(second.max, (std::array<float, 3>{1, 69, 0}));
  const Decomposition::Segment& group = whole.levels[1].segments[0];
  EXPECT_EQ(group.min, (std::array<float, 3>{0, 0, 0}));
  EXPECT_EQ(group.max, (std::array<float, 3>{1, 69, 0}));
}

TEST(Decompose, RequiresALargerCosineOfGaussiansThatViewsHardlyShow) {
  NestedParts nested = MakeNestedParts();
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
  NestedParts nested = MakeNestedParts();
  ModelView view;
  view.camera = {1, 1, 1, 1, 0.5, 0.5};
  nested.model.views = {view};
  EXPECT_STATUS(DecomposeWithoutViews(nested.model, {0.5}), absl::StatusCode::kInternal,
                "unexpected request for rows");
}

TEST(Decompose, GivesTheSameLevelForAScaleAlone) {
  const NestedParts nested = MakeNestedParts();
  ASSERT_OK_AND_ASSIGN(const Decomposition both, DecomposeWithoutViews(nested.model, {0.01, 1}));
  ASSERT_OK_AND_ASSIGN(const Decomposition one, DecomposeWithoutViews(nested.model, {1}));
  ASSERT_EQ(one.levels.size(), 1u);
  EXPECT_EQ(one.levels[0].ids, both.levels[1].ids);
}

TEST(Decompose, LeavesTooFewGaussiansForAPieceInNoSegment) {
  Model model = MakeNestedParts().model;
  const std::vector<int64_t> rows = {0, 1, 2, 3, 4};
  model.gaussians = model.gaussians.Select(rows);
  model.field.features.resize(32 * rows.size());
  ASSERT_OK_AND_ASSIGN(const Decomposition whole, DecomposeWithoutViews(model, {0.5}));
  EXPECT_TRUE(whole.levels[0].segments.empty());
  EXPECT_EQ(whole.levels[0].ids, std::vector<int32_t>(5));
}

// Returns features of a thing of two halves and of one that is whole, in regular grids of 5 x 5 and
// 5 x 6 Gaussians, 0.02 apart. The halves are 0.03 apart: as one they are the more stable cluster.
Model MakeHalves() {
  Model model;
  std::vector<float>& features = model.field.features;
  for (int i = 0; i < 80; ++i) {
    const int half = i / 25, row = i % 25 / 5, column = i % 5;
    const bool whole = i >= 50;
    features.resize(features.size() + 32);
    float* const feature = &features[features.size() - 32];
    feature[whole ? 1 : 0] = 1;
    feature[2] = 0.02f * static_cast<float>(column);
    feature[3] = whole ? 0.02f * static_cast<float>((i - 50) / 5)
                       : 0.02f * static_cast<float>(row) + 0.11f * static_cast<float>(half);
  }
  model.gaussians = Gaussians::Zero(80, 0);
  model.field.scale_quantiles = {1, 3};
  return model;
}

TEST(Decompose, SplitsPiecesAtScale0) {
  const Model model = MakeHalves();
  ASSERT_OK_AND_ASSIGN(const Decomposition plain, DecomposeWithoutViews(model, {0.01, 1}));
  ASSERT_EQ(plain.levels[0].segments.size(), 2u);
  ASSERT_OK_AND_ASSIGN(const Decomposition split, DecomposeWithoutViews(model, {0, 0.01, 1}));
  ASSERT_EQ(split.levels.size(), 3u);
  EXPECT_EQ(split.levels[1].ids, plain.levels[0].ids);
  EXPECT_EQ(split.levels[2].ids, plain.levels[1].ids);
  const Decomposition::Level& pieces = split.levels[0];
  ASSERT_EQ(pieces.segments.size(), 3u) << "two halves and the whole one";
  EXPECT_EQ(pieces.segments[0].num_gaussians, 30);
  EXPECT_EQ(pieces.segments[0].parent, 2);
  EXPECT_EQ(pieces.segments[1].parent, 1);
  EXPECT_EQ(pieces.segments[2].parent, 1);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(pieces.ids[i], i < 25 ? 2 : 3) << i;
  ASSERT_OK_AND_ASSIGN(const Decomposition alone, DecomposeWithoutViews(model, {0}));
  EXPECT_EQ(alone.levels[0].ids, pieces.ids);
}

TEST(Decompose, RefusesBadScales) {
  const Model model = MakeNestedParts().model;
  const auto expect_refused = [&](const std::vector<double>& scales, const std::string& words) {
    EXPECT_STATUS(DecomposeWithoutViews(model, scales), absl::StatusCode::kInvalidArgument, words);
  };
  expect_refused({}, "0 scales; allowed are 1..8");
  expect_refused(std::vector<double>(9, 0.5), "9 scales");
  expect_refused({0.5, 1.5}, "[1] is 1.5, not in [0, 1]");
  expect_refused({NAN}, "[0] is nan");
  expect_refused({0.5, 0.5}, "[1] is 0.5, not over the scale before, 0.5");
}

TEST(MembersOf, ReturnsTheGaussiansOfASegment) {
  const NestedParts nested = MakeNestedParts();
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

// Returns directions in a plane, [n, 32]. rays: angle in degrees, and length.
std::vector<float> Fan(const std::vector<std::pair<double, double>>& rays) {
  std::vector<float> sums;
  for (const auto& [degrees, length] : rays) {
    const double angle = degrees * M_PI / 180;
    std::vector<float> sum(32);
    sum[0] = static_cast<float>(length * std::cos(angle));
    sum[5] = static_cast<float>(length * std::sin(angle));
    sums.insert(sums.end(), sum.begin(), sum.end());
  }
  return sums;
}

const double kCosine20 = std::cos(20 * M_PI / 180);

TEST(JoinPieces, JoinsCloseDirections) {
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {90, 1}, {10, 1}, {95, 2}, {180, 1}}), kCosine20),
            (std::vector<int32_t>{0, 1, 0, 1, 2}));
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {10, 1}}), 1), (std::vector<int32_t>{0, 1}));
  EXPECT_TRUE(JoinPieces({}, 0.5).empty());
}

TEST(JoinPieces, JoinsTheClosestFirstAndWeighsByLength) {
  // 15 and 29 degrees are joined first, at 22 degrees: too far from 0.
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {15, 1}, {29, 1}}), kCosine20),
            (std::vector<int32_t>{0, 1, 1}));
  EXPECT_EQ(JoinPieces(Fan({{0, 1}, {14, 100}, {33, 1}}), kCosine20),
            (std::vector<int32_t>{0, 0, 0}))
      << "the heavy piece keeps its direction";
  EXPECT_EQ(JoinPieces(Fan({{0, 100}, {14, 1}, {33, 1}}), kCosine20),
            (std::vector<int32_t>{0, 0, 1}));
}

TEST(JoinPieces, NeverJoinsZeros) {
  EXPECT_EQ(JoinPieces(Fan({{0, 0}, {0, 1}, {0, 0}, {0, 2}}), -1),
            (std::vector<int32_t>{0, 1, 2, 1}));
}

// Joins one pair at a time and computes all cosines again each time.
std::vector<int32_t> JoinNaively(std::vector<float> sums, double join_cosine) {
  const size_t count = sums.size() / 32;
  std::vector<int32_t> to(count);
  for (size_t i = 0; i < count; ++i) to[i] = static_cast<int32_t>(i);
  for (;;) {
    double best = join_cosine;
    size_t best_a = 0, best_b = 0;
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        if (to[a] != static_cast<int32_t>(a) || to[b] != static_cast<int32_t>(b)) continue;
        double ab = 0, aa = 0, bb = 0;
        for (int k = 0; k < 32; ++k) {
          const double x = sums[32 * a + k], y = sums[32 * b + k];
          ab += x * y, aa += x * x, bb += y * y;
        }
        const double cosine = ab / std::sqrt(aa * bb);
        if (cosine > best) best = cosine, best_a = a, best_b = b;
      }
    }
    if (best_b == 0) return to;
    for (int k = 0; k < 32; ++k) sums[32 * best_a + k] += sums[32 * best_b + k];
    for (int32_t& target : to) {
      if (target == static_cast<int32_t>(best_b)) target = static_cast<int32_t>(best_a);
    }
  }
}

TEST(JoinPieces, AgreesWithANaiveImplementation) {
  std::mt19937 random(8);
  std::normal_distribution<float> normal;
  for (int round = 0; round < 5; ++round) {
    std::vector<float> sums(32 * 40);
    for (size_t i = 0; i < sums.size(); ++i) {
      sums[i] = normal(random) + (i % 32 == 0 ? 4.0f : 0.0f);
    }
    const std::vector<int32_t> got = JoinPieces(sums, 0.6), want = JoinNaively(sums, 0.6);
    for (size_t a = 0; a < got.size(); ++a) {
      for (size_t b = 0; b < a; ++b) EXPECT_EQ(got[a] == got[b], want[a] == want[b]);
    }
    EXPECT_NE(got, JoinPieces(sums, 0.99)) << "something was joined";
  }
}

}  // namespace
}  // namespace pepeseg
