#include "core/find/appearance.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using testing::PairOfBlobs;

constexpr int kGrid = 8;

int QuadrantOf(int pixel) { return (pixel / kGrid >= kGrid / 2 ? 2 : 0) + (pixel % kGrid >= 4); }

// Four segments of one level fill a quadrant of the grid of each of two views.
SceneSegments FourQuadrants() {
  SceneSegments all;
  all.first = {0};
  for (int32_t s = 0; s < 4; ++s) {
    SceneSegments::Segment segment;
    segment.key = {0, s + 1};
    segment.num_gaussians = 10;
    segment.extents = {2, 1, 1};
    all.segments.push_back(segment);
  }
  for (size_t v = 0; v < 2; ++v) {
    SeenView seen;
    seen.view = v;
    seen.width = seen.height = kGrid;
    seen.areas.assign(4, {16, 0, 0, 0, 0});
    seen.shown.emplace_back();
    for (int i = 0; i < kGrid * kGrid; ++i) seen.shown[0].push_back(QuadrantOf(i));
    all.views.push_back(seen);
  }
  return all;
}

// Sees quadrant 2 apart from the others. A channel that only tells the views apart is much larger.
class QuadrantEncoder final : public ImageEncoder {
 public:
  absl::StatusOr<ImageFeatures> Encode(const ModelView& view, int width, int height,
                                       const WantedCheck&) override {
    ImageFeatures features;
    features.channels = 4;
    const float of_view = view.name == "front" ? 10 : -10;
    for (int quadrant = 0; quadrant < 4; ++quadrant) {
      const bool other = quadrant == 2;
      for (const float value : {other ? 0.0f : 1.0f, other ? 1.0f : 0.0f, 0.5f, of_view}) {
        features.values.push_back(HalfFromFloat(value));
      }
    }
    for (int i = 0; i < width * height; ++i) features.cells.push_back(QuadrantOf(i));
    return features;
  }
};

class AppearanceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Model model = PairOfBlobs(48);
    model.views.push_back(model.views[0]);
    model.views.back().name = "second";
    ASSERT_OK_AND_ASSIGN(model_, SceneModel::Create(*backend_, std::move(model)));
  }
  absl::StatusOr<Appearance> Look() {
    return Appearance::Look(*model_, all_, encoder_, [] { return absl::OkStatus(); });
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(1);
  std::unique_ptr<SceneModel> model_;
  SceneSegments all_ = FourQuadrants();
  QuadrantEncoder encoder_;
};

TEST_F(AppearanceTest, ScoresWhatLooksAlike) {
  ASSERT_OK_AND_ASSIGN(const Appearance looks, Look());
  const std::vector<double> scores = looks.ScoresLike({0, {}});
  ASSERT_EQ(scores.size(), 4u);
  EXPECT_NEAR(scores[0], 1, 1e-5);
  EXPECT_NEAR(scores[1], 1, 1e-5) << "what differs between views does not count";
  EXPECT_NEAR(scores[2], std::exp(-4), 1e-5) << "the opposite: a cosine of -1";
}

TEST_F(AppearanceTest, ScoresOtherSizesAndColoursLower) {
  for (float& extent : all_.segments[1].extents) extent *= 4;
  all_.segments[3].color = {0.2f, 0, 0};
  ASSERT_OK_AND_ASSIGN(const Appearance looks, Look());
  const std::vector<double> scores = looks.ScoresLike({0, {}});
  EXPECT_NEAR(scores[1], std::exp(-2 * 0.5 * std::log(4.0)), 1e-4);
  EXPECT_NEAR(scores[3], std::exp(-2 * 0.2), 1e-4);
}

TEST_F(AppearanceTest, LeavesOutWhatIsHardlySeen) {
  for (SeenView& seen : all_.views) seen.areas[1].pixels = 3;
  ASSERT_OK_AND_ASSIGN(const Appearance looks, Look());
  EXPECT_EQ(looks.ScoresLike({0, {}})[1], 0);
}

TEST_F(AppearanceTest, ComparesWithPixelsOfNoSegment) {
  ASSERT_OK_AND_ASSIGN(const Appearance looks, Look());
  ASSERT_OK_AND_ASSIGN(
      const ImageFeatures features,
      encoder_.Encode(model_->model().views[0], kGrid, kGrid, [] { return absl::OkStatus(); }));
  std::vector<uint8_t> inside(kGrid * kGrid);
  EXPECT_TRUE(MeanFeatures(features, inside).empty());
  for (int i = 0; i < kGrid * kGrid; ++i) inside[i] = QuadrantOf(i) == 2 ? 1 : 0;
  const std::vector<float> mean = MeanFeatures(features, inside);
  EXPECT_EQ(mean, (std::vector<float>{0, 1, 0.5f, 10}));
  const std::vector<double> scores = looks.ScoresLike({-1, mean});
  // The pixels differ from the mean of the segments by (-0.75, 0.75, 0, 10), where the last is what
  // only their view shows, and segment 2 by (-0.75, 0.75, 0, 0). The variance between views is 100
  // in the last channel, and the shrinkage adds 0.3 x 100 / 4 to all.
  const double shown = 0.75 / std::sqrt(7.5), of_view = 10 / std::sqrt(107.5);
  const double cosine = std::sqrt(2.0) * shown / std::hypot(std::sqrt(2.0) * shown, of_view);
  EXPECT_NEAR(scores[2], std::exp(-2 * (1 - cosine)), 1e-4);
  EXPECT_NEAR(scores[0], std::exp(-2 * (1 + cosine)), 1e-4);
}

TEST(BestApart, KeepsTheBetterOfTwoThatShareGaussians) {
  SceneSegments all = FourQuadrants();
  all.segments[3].key = {1, 1};
  all.segments[3].num_gaussians = 20;
  all.segments[0].parent = all.segments[1].parent = 3;
  EXPECT_EQ(BestApart(all, std::vector<double>{0.9, 0.5, 0.1, 0.6}, 0.2, 10),
            (std::vector<int32_t>{0, 1}));
  EXPECT_EQ(BestApart(all, std::vector<double>{0.5, 0.4, 0.3, 0.6}, 0.2, 10),
            (std::vector<int32_t>{3, 2}));
  EXPECT_EQ(BestApart(all, std::vector<double>{0.5, 0.4, 0.3, 0}, 0.2, 1),
            (std::vector<int32_t>{0}));
}

}  // namespace
}  // namespace pepeseg
