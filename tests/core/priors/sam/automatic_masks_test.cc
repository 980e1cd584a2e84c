#include "core/priors/sam/automatic_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/testing/status_testing.h"

// SegmentPhotograph with a stand-in for the network that answers from a drawing.
namespace pepeseg {
namespace {

constexpr int kWidth = 64, kHeight = 48;

// Returns true inside a thing, for a position in pixels.
using Thing = std::function<bool(double x, double y)>;
Thing Disc(double x0, double y0, double radius) {
  return [=](double x, double y) { return std::hypot(x - x0, y - y0) < radius; };
}
Thing Rest(const Thing& whole, const Thing& part) {
  return [=](double x, double y) { return whole(x, y) && !part(x, y); };
}

struct DrawnThing {
  Thing holds;
  float iou = 0.95F;  // the estimate that the network returns
  float logit = 8;    // inside the thing; -logit outside
};

// Answers a prompt of one point with the things that hold it, in their order, and a prompt of
// several points with the hidden things that hold the positive ones and not the negative ones.
class DrawingSegmenter : public PromptedSegmenter {
 public:
  explicit DrawingSegmenter(std::vector<DrawnThing> things, std::vector<DrawnThing> hidden = {})
      : things_(std::move(things)), hidden_(std::move(hidden)) {}

  absl::Status SetPhotograph(const Image& photo) override {
    grid_ = AnswerGrid(photo.width, photo.height);
    return absl::OkStatus();
  }
  absl::StatusOr<PromptAnswers> Segment(std::span<const SegmenterPrompt> prompts) override {
    PromptAnswers answers = grid_;
    runs.push_back(prompts.size());
    for (const SegmenterPrompt& prompt : prompts) {
      if (prompt.size() == 1) points.push_back(prompt[0]);
      num_several += prompt.size() > 1;
      std::vector<const DrawnThing*> meant(1, nullptr);  // mask 0
      for (const DrawnThing& thing : prompt.size() > 1 ? hidden_ : things_) {
        const bool fits = std::all_of(prompt.begin(), prompt.end(), [&](const PromptPoint& point) {
          return thing.holds(point.x, point.y) == point.positive;
        });
        if (fits) meant.push_back(&thing);
      }
      meant.resize(PromptAnswers::kMasks, nullptr);
      for (const DrawnThing* thing : meant) Append(thing, answers);
    }
    return answers;
  }

  std::vector<PromptPoint> points;
  std::vector<size_t> runs;
  int num_several = 0;

 private:
  void Append(const DrawnThing* thing, PromptAnswers& answers) const {
    answers.ious.push_back(thing == nullptr ? 0 : thing->iou);
    for (int y = 0; y < grid_.height; ++y) {
      for (int x = 0; x < grid_.width; ++x) {
        const bool inside = thing != nullptr && thing->holds((x + 0.5) / grid_.cells_per_pixel,
                                                             (y + 0.5) / grid_.cells_per_pixel);
        answers.logits.push_back(thing == nullptr ? -1 : inside ? thing->logit : -thing->logit);
      }
    }
  }

  std::vector<DrawnThing> things_, hidden_;
  PromptAnswers grid_;
};

View TestView() {
  View view;
  view.photo = {kWidth, kHeight, 3, std::vector<uint8_t>(kWidth * kHeight * 3)};
  return view;
}

absl::Status Proceed() { return absl::OkStatus(); }

AutomaticMasks Segment(DrawingSegmenter& segmenter, const AutomaticMaskOptions& options,
                       const MaskSet& embedded = {}, const View& view = TestView()) {
  auto made = SegmentPhotograph(segmenter, view, embedded, options, Proceed);
  EXPECT_OK(made);
  return *std::move(made);
}

double IouWith(const MaskSet& masks, int k, const Thing& thing) {
  const BinaryMask mask = masks.Extract(k);
  double common = 0, united = 0;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const bool inside = thing(i % kWidth + 0.5, i / kWidth + 0.5);
    common += inside && mask.pixels[i] != 0;
    united += inside || mask.pixels[i] != 0;
  }
  return common / united;
}
double BestIou(const MaskSet& masks, const Thing& thing) {
  double best = 0;
  for (int k = 0; k < masks.num_masks; ++k) best = std::max(best, IouWith(masks, k, thing));
  return best;
}

MaskSet OneMask(const Thing& thing) {
  BinaryMask mask;
  for (int i = 0; i < kWidth * kHeight; ++i) {
    mask.pixels.push_back(thing(i % kWidth + 0.5, i / kWidth + 0.5) ? 1 : 0);
  }
  return BuildMaskSet(kWidth, kHeight, {&mask, 1});
}

const Thing kBig = Disc(32, 24, 18), kSmall = Disc(32, 24, 10), kFar = Disc(56, 8, 5);

AutomaticMaskOptions Grid(int points_per_side) {
  AutomaticMaskOptions options;
  options.points_per_side = points_per_side;
  return options;
}

TEST(SegmentPhotograph, PromptsAtEachPointOfTheGridInBatches) {
  DrawingSegmenter segmenter({});
  const AutomaticMasks made = Segment(segmenter, Grid(5));
  EXPECT_EQ(made.num_prompts, 25);
  EXPECT_EQ(made.masks.num_masks, 0);
  EXPECT_THAT(segmenter.runs, ::testing::ElementsAre(4, 4, 4, 4, 4, 4, 1));
  std::set<std::pair<float, float>> places;
  for (const PromptPoint& point : segmenter.points) places.emplace(point.x, point.y);
  EXPECT_EQ(places.size(), 25u);
  EXPECT_TRUE(places.contains({0.1F * kWidth, 0.1F * kHeight}));
  EXPECT_TRUE(places.contains({0.9F * kWidth, 0.5F * kHeight}));
}

TEST(SegmentPhotograph, KeepsEachThingOnce) {
  DrawingSegmenter segmenter({{kSmall}, {kBig}, {kFar}});
  const MaskSet masks = Segment(segmenter, Grid(12)).masks;
  EXPECT_EQ(masks.num_masks, 3);
  for (const Thing& thing : {kSmall, kBig, kFar}) EXPECT_GT(BestIou(masks, thing), 0.93);
}

// A ring and its disc have the same box, but are kept both.
TEST(SegmentPhotograph, SuppressesByMasksAndNotByBoxes) {
  const Thing ring = Rest(kBig, Disc(32, 24, 14));
  DrawingSegmenter segmenter({{kBig}, {ring}, {Disc(32.5, 24, 18), 0.9F}});
  const MaskSet masks = Segment(segmenter, Grid(12)).masks;
  EXPECT_EQ(masks.num_masks, 2);
  EXPECT_GT(BestIou(masks, ring), 0.85);
}

TEST(SegmentPhotograph, KeepsFillersOnlyWhereNoSureMaskIs) {
  DrawingSegmenter segmenter({{kBig}, {kSmall, 0.75F}, {kFar, 0.75F}});
  const MaskSet masks = Segment(segmenter, Grid(12)).masks;
  EXPECT_EQ(masks.num_masks, 2);
  EXPECT_GT(BestIou(masks, kFar), 0.9);
  EXPECT_LT(BestIou(masks, kSmall), 0.5);
}

TEST(SegmentPhotograph, DropsUnstableMasks) {
  DrawingSegmenter segmenter({{kBig, 0.95F, 0.5F}});  // logits below 1
  EXPECT_EQ(Segment(segmenter, Grid(8)).masks.num_masks, 0);
}

TEST(SegmentPhotograph, PromptsForTheRemainderOfAMaskThatHoldsAnother) {
  const Thing rest = Rest(kBig, kSmall);
  DrawingSegmenter segmenter({{kBig}, {kSmall}}, {{rest}});
  const AutomaticMasks made = Segment(segmenter, Grid(10));
  EXPECT_EQ(segmenter.num_several, 1);
  EXPECT_EQ(made.num_prompts, 101);
  EXPECT_EQ(made.masks.num_masks, 3);
  EXPECT_GT(BestIou(made.masks, rest), 0.9);
  AutomaticMaskOptions options = Grid(10);
  options.min_remainder_iou = 1;
  EXPECT_EQ(Segment(segmenter, options).masks.num_masks, 2);
}

TEST(SegmentPhotograph, DropsAnAnswerThatIsNotTheRemainder) {
  DrawingSegmenter segmenter({{kBig}, {kSmall}}, {{Rest(kFar, kSmall)}, {Disc(32, 40, 4)}});
  EXPECT_EQ(Segment(segmenter, Grid(10)).masks.num_masks, 2);
}

TEST(SegmentPhotograph, SkipsPointsThatASmallSureMaskHolds) {
  DrawingSegmenter segmenter({{kBig}});
  AutomaticMaskOptions options = Grid(16);
  const int num_all = Segment(segmenter, options).num_prompts;
  options.settled_area = 0.2;  // the disc has 0.33 of the photograph
  EXPECT_EQ(Segment(segmenter, options).num_prompts, num_all);
  options.settled_area = 0.5;
  const AutomaticMasks made = Segment(segmenter, options);
  EXPECT_LT(made.num_prompts, num_all - 60);
  EXPECT_EQ(made.masks.num_masks, 1);
}

TEST(SegmentPhotograph, PromptsAtTheDeepestPointsOfEmbeddedMasks) {
  DrawingSegmenter segmenter({{kFar}});
  AutomaticMaskOptions options = Grid(0);
  options.region_points = true;
  const AutomaticMasks made = Segment(segmenter, options, OneMask(kFar));
  ASSERT_EQ(segmenter.points.size(), 1u);
  EXPECT_NEAR(segmenter.points[0].x, 56, 1);
  EXPECT_NEAR(segmenter.points[0].y, 8, 1);
  EXPECT_EQ(made.masks.num_masks, 1);
  options.region_points = false;
  EXPECT_EQ(Segment(segmenter, options, OneMask(kFar)).num_prompts, 0);
}

TEST(SegmentPhotograph, AddsEmbeddedMasksThatAreNotDuplicates) {
  DrawingSegmenter segmenter({{kBig}});
  AutomaticMaskOptions options = Grid(8);
  EXPECT_EQ(Segment(segmenter, options, OneMask(kFar)).masks.num_masks, 2);
  EXPECT_EQ(Segment(segmenter, options, OneMask(Disc(32, 24, 17.5))).masks.num_masks, 1);
  options.join_embedded = false;
  EXPECT_EQ(Segment(segmenter, options, OneMask(kFar)).masks.num_masks, 1);
}

TEST(SegmentPhotograph, LeavesOutIgnoredPixels) {
  DrawingSegmenter segmenter({{kBig}});
  View view = TestView();
  view.ignore.assign(kWidth * kHeight, 0);
  for (int i = 0; i < kWidth * 24; ++i) view.ignore[i] = 1;
  const MaskSet masks = Segment(segmenter, Grid(8), OneMask(kFar), view).masks;
  ASSERT_EQ(masks.num_masks, 1);  // all of the embedded mask is ignored
  EXPECT_FALSE(masks.Covers(0, 32, 20));
  EXPECT_TRUE(masks.Covers(0, 32, 30));
}

TEST(SegmentPhotograph, EndsWithTheErrorOfItsProgress) {
  DrawingSegmenter segmenter({{kBig}});
  int calls = 0;
  const auto made = SegmentPhotograph(segmenter, TestView(), {}, Grid(16), [&calls] {
    return ++calls == 5 ? absl::CancelledError("stopped") : absl::OkStatus();
  });
  EXPECT_TRUE(absl::IsCancelled(made.status()));
  EXPECT_EQ(segmenter.runs.size(), 3u);  // progress is called once before SetPhotograph
}

TEST(SegmentPhotograph, ReturnsTheSameMasksEachTime) {
  DrawingSegmenter segmenter({{kSmall}, {kBig}, {kFar}});
  const MaskSet first = Segment(segmenter, Grid(12)).masks;
  EXPECT_EQ(Segment(segmenter, Grid(12)).masks.pixel_cell, first.pixel_cell);
}

constexpr int kSetWidth = 8, kSetHeight = 4;  // of the masks that JoinMasks joins

// Returns a mask of the columns [first, last).
BinaryMask Columns(int first, int last) {
  BinaryMask mask;
  for (int i = 0; i < kSetWidth * kSetHeight; ++i) {
    mask.pixels.push_back(i % kSetWidth >= first && i % kSetWidth < last ? 1 : 0);
  }
  return mask;
}

MaskSet Set(const std::vector<BinaryMask>& masks) {
  return BuildMaskSet(kSetWidth, kSetHeight, masks);
}

TEST(JoinMasks, DropsNearDuplicatesOfEarlierMasks) {
  const MaskSet joined = JoinMasks(Set({Columns(0, 5)}), Set({Columns(0, 6), Columns(2, 8)}), {});
  ASSERT_EQ(joined.num_masks, 2);
  EXPECT_EQ(joined.Extract(0).pixels, Columns(0, 5).pixels);
  EXPECT_EQ(joined.Extract(1).pixels, Columns(2, 8).pixels);
}

TEST(JoinMasks, LeavesIgnoredPixelsOut) {
  const std::vector<uint8_t> ignore = Columns(4, 8).pixels;
  const MaskSet joined = JoinMasks(Set({Columns(2, 6), Columns(5, 7)}), {}, ignore);
  ASSERT_EQ(joined.num_masks, 1);
  EXPECT_EQ(joined.Extract(0).pixels, Columns(2, 4).pixels);
}

}  // namespace
}  // namespace pepeseg
