#include "core/find/word_votes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace pepeseg {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int kViewSide = 20;
enum Number : int32_t { kLeft, kRight, kBoth };  // of a segment; the last holds the others
enum Word : int { kCup, kBowl, kNumWords };

struct Area {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // x1 and y1 are past the last pixel
};
constexpr Area kLeftArea = {2, 4, 8, 12}, kRightArea = {11, 4, 17, 12}, kBothArea = {2, 4, 17, 12};

// Two things next to each other, which are the only segment of the coarse level, as `num_views`
// views see them.
SceneSegments TwoThings(int num_views) {
  SceneSegments scene;
  scene.segments = {
      {{0, 1}, kBoth, 5, {}, {}}, {{0, 2}, kBoth, 4, {}, {}}, {{1, 1}, -1, 9, {}, {}}};
  scene.first = {0, 2};
  SeenView view = {0, kViewSide, kViewSide, {}, {}};
  view.shown.assign(2, std::vector<int32_t>(kViewSide * kViewSide, -1));
  for (const auto& [area, segment] : {std::pair{kLeftArea, kLeft}, {kRightArea, kRight}}) {
    for (int y = area.y0; y < area.y1; ++y) {
      for (int x = area.x0; x < area.x1; ++x) {
        view.shown[0][y * kViewSide + x] = segment;
        view.shown[1][y * kViewSide + x] = kBoth;
      }
    }
  }
  for (const Area& area : {kLeftArea, kRightArea, kBothArea}) {
    view.areas.push_back(
        {(area.x1 - area.x0) * (area.y1 - area.y0), area.x0, area.y0, area.x1 - 1, area.y1 - 1});
  }
  for (int v = 0; v < num_views; ++v) {
    scene.views.push_back(view);
    scene.views.back().view = v;
  }
  return scene;
}

Sighting Box(int word, float score, const Area& area) {
  const auto share = [](int at) { return static_cast<float>(at) / kViewSide; };
  return {word, score, share(area.x0), share(area.y0), share(area.x1), share(area.y1)};
}

using Sightings = std::vector<std::vector<Sighting>>;

auto Is(int32_t segment, int word, double score) {
  return ::testing::AllOf(
      ::testing::Field(&SegmentWord::segment, segment), ::testing::Field(&SegmentWord::word, word),
      ::testing::Field(&SegmentWord::score, ::testing::DoubleNear(score, 1e-6)));
}

TEST(WordVotes, GoToTheSegmentsThatBoxesFit) {
  const SceneSegments scene = TwoThings(2);
  const Sightings seen(2, {Box(kCup, 0.5, kLeftArea), Box(kBowl, 0.75, kRightArea)});
  EXPECT_THAT(VoteWords(scene, seen, kNumWords),
              ElementsAre(Is(kRight, kBowl, 0.75), Is(kLeft, kCup, 0.5)));
}

TEST(WordVotes, GiveASegmentTheWordThatIsSeenMost) {
  const SceneSegments scene = TwoThings(2);
  const Sightings seen = {{Box(kCup, 0.5, kLeftArea), Box(kBowl, 0.6F, kLeftArea)},
                          {Box(kCup, 0.5, kLeftArea), Box(kBowl, 0.25, kLeftArea)}};
  EXPECT_THAT(VoteWords(scene, seen, kNumWords), ElementsAre(Is(kLeft, kCup, 0.5)));
}

TEST(WordVotes, CountTheBetterHalfOfTheViews) {
  const SceneSegments scene = TwoThings(6);
  Sightings seen(6);
  seen[0] = seen[3] = seen[4] = {Box(kCup, 0.5, kLeftArea)};
  EXPECT_THAT(VoteWords(scene, seen, kNumWords), ElementsAre(Is(kLeft, kCup, 0.5)));
  seen[4].clear();
  EXPECT_THAT(VoteWords(scene, seen, kNumWords), ElementsAre(Is(kLeft, kCup, 1.0 / 3)));
}

TEST(WordVotes, DoNotTrustASingleView) {
  const SceneSegments scene = TwoThings(1);
  const Sightings seen = {{Box(kCup, 0.8F, kLeftArea)}};
  EXPECT_THAT(VoteWords(scene, seen, kNumWords), ElementsAre(Is(kLeft, kCup, 0.4)));
}

TEST(WordVotes, LeaveOutViewsThatHardlyShowTheSegment) {
  SceneSegments scene = TwoThings(4);
  Sightings seen(4, {Box(kCup, 0.5, kLeftArea)});
  for (int v = 0; v < 2; ++v) {
    seen[v].clear();
    scene.views[v].areas[kLeft].pixels = kSightedPixels - 1;
  }
  EXPECT_THAT(VoteWords(scene, seen, kNumWords), ElementsAre(Is(kLeft, kCup, 0.5)));
}

TEST(WordVotes, WeighBoxesByTheirFit) {
  const SceneSegments scene = TwoThings(2);
  // Three quarters of the left thing, then less than half of it.
  const Sightings most(2, {Box(kCup, 0.8F, {2, 4, 8, 10})});
  EXPECT_THAT(VoteWords(scene, most, kNumWords), ElementsAre(Is(kLeft, kCup, 0.6)));
  const Sightings part(2, {Box(kCup, 0.8F, {2, 4, 8, 7})});
  EXPECT_THAT(VoteWords(scene, part, kNumWords), IsEmpty());
}

TEST(WordVotes, CompareMasksWithPixels) {
  const SceneSegments scene = TwoThings(2);
  // A mask of twice the grid's size, of the left thing; its box, of both things, does not count.
  Sighting mask = Box(kCup, 0.5, kBothArea);
  mask.mask_width = mask.mask_height = 2 * kViewSide;
  mask.mask.pixels.resize(size_t{4} * kViewSide * kViewSide);
  for (int y = 2 * kLeftArea.y0; y < 2 * kLeftArea.y1; ++y) {
    for (int x = 2 * kLeftArea.x0; x < 2 * kLeftArea.x1; ++x) {
      mask.mask.pixels[y * 2 * kViewSide + x] = 1;
    }
  }
  EXPECT_THAT(VoteWords(scene, Sightings(2, {mask}), kNumWords), ElementsAre(Is(kLeft, kCup, 0.5)));
}

TEST(ThingsOfWord, AreTheBestOfSegmentsThatLieInEachOther) {
  const SceneSegments scene = TwoThings(1);
  const std::vector<SegmentWord> apart = {
      {kLeft, kCup, 0.5}, {kRight, kCup, 0.4}, {kBoth, kCup, 0.3}, {kBoth, kBowl, 0.9}};
  EXPECT_THAT(ThingsOfWord(scene, apart, kCup),
              ElementsAre(Is(kLeft, kCup, 0.5), Is(kRight, kCup, 0.4)));
  const std::vector<SegmentWord> whole = {{kBoth, kCup, 0.5}, {kRight, kCup, 0.4}};
  EXPECT_THAT(ThingsOfWord(scene, whole, kCup), ElementsAre(Is(kBoth, kCup, 0.5)));
  EXPECT_THAT(ThingsOfWord(scene, whole, kBowl), IsEmpty());
}

}  // namespace
}  // namespace pepeseg
