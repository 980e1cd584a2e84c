#include "core/query/prompted_thing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"
#include "tests/testing/front_blobs.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Answers with masks of its own, and notes what it is asked.
class ScriptedImages final : public ImageSegmenter {
 public:
  absl::StatusOr<ImageMasks> Click(const ModelView&, std::span<const PointPrompt> clicks,
                                   const SoftMask* before, const WantedCheck&) override {
    asked.push_back({clicks.begin(), clicks.end()});
    befores.push_back(before != nullptr ? before->iou : -1);
    RETURN_IF_ERROR(error);
    if (before == nullptr) return ImageMasks{first, BorderImage::kRendering};
    return ImageMasks{{next}, BorderImage::kRendering};
  }
  absl::StatusOr<ImageMasks> Box(const ModelView&, const BoxPrompt& box,
                                 const WantedCheck&) override {
    boxes.push_back(box);
    RETURN_IF_ERROR(error);
    return ImageMasks{first, BorderImage::kRendering};
  }
  absl::Status Refine(const ModelView& view, Change change, const WantedCheck&,
                      SegmentResult& result) override {
    refined.push_back(view.name);
    EXPECT_EQ(change, Change::kWhole);
    result.border_image = BorderImage::kPhotograph;
    return absl::OkStatus();
  }

  std::vector<SoftMask> first;
  SoftMask next;
  absl::Status error;
  std::vector<PointsPrompt> asked;
  std::vector<BoxPrompt> boxes;
  std::vector<double> befores;  // estimated IoU of the mask before; -1: none
  std::vector<std::string> refined;
};

class PromptedThingTest : public ::testing::Test {
 protected:
  static constexpr int kSize = 48;
  static constexpr int kLeftX = 17, kRightX = 30, kY = 24;
  static constexpr PointPrompt kLeft = {kLeftX + 0.5, kY + 0.5, true};

  void SetUp() override {
    Model model = testing::PairOfBlobs(kSize);
    other_ = model.views[0];
    other_.name = "other";
    other_.cam_from_world.translation.x() += 0.05;
    model.views.push_back(other_);
    ASSERT_OK_AND_ASSIGN(model_, Segmenter::Create(*backend_, std::move(model)));
    view_ = model_->model().views[0];
    ASSERT_OK_AND_ASSIGN(left_, MaskAt(0.0));
    ASSERT_OK_AND_ASSIGN(both_, MaskAt(1.0));
  }
  // Returns the model's mask of a click on the left blob at a scale.
  absl::StatusOr<BinaryMask> MaskAt(double scale) const {
    ASSIGN_OR_RETURN(const Query query,
                     ResolvePrompt(*model_, {view_, PointsPrompt{kLeft}}, {scale, 0.75}));
    ASSIGN_OR_RETURN(auto results, model_->Segment(query, {&view_, 1}));
    return std::move(results[0].mask);
  }
  absl::StatusOr<PromptedThing> Find(const PointsPrompt& clicks) {
    return PromptedThing::Find(*model_, &images_, {view_, clicks}, {},
                               [] { return absl::OkStatus(); });
  }
  absl::StatusOr<SegmentResult> In(PromptedThing& thing, const ModelView& view) {
    return thing.In(view, {}, [] { return absl::OkStatus(); });
  }
  static BinaryMask Square(int x0, int x1) {
    BinaryMask mask;
    for (int i = 0; i < kSize * kSize; ++i) {
      const int x = i % kSize, y = i / kSize;
      mask.pixels.push_back(x >= x0 && x < x1 && y >= 20 && y < 28 ? 1 : 0);
    }
    return mask;
  }

  std::unique_ptr<Backend> backend_ = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> model_;
  ModelView view_, other_;
  BinaryMask left_, both_;
  ScriptedImages images_;
};

TEST_F(PromptedThingTest, TakesTheMaskThatTheModelConfirms) {
  const BinaryMask stripe = Square(0, kSize);
  images_.first = {{stripe, 0.95, {}}, {left_, 0.8, {}}, {Square(2, 6), 0.9, {}}};
  ASSERT_OK_AND_ASSIGN(PromptedThing thing, Find({kLeft}));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, In(thing, view_));
  EXPECT_EQ(result.mask.pixels, left_.pixels);
  EXPECT_EQ(result.border_image, BorderImage::kRendering);
  EXPECT_TRUE(images_.refined.empty());  // the mask is the segmenter's own
}

TEST_F(PromptedThingTest, TakesTheSurestMaskWhereTheModelShowsNothing) {
  images_.first = {{Square(1, 4), 0.5, {}}, {Square(1, 6), 0.9, {}}};
  const PointPrompt corner = {3.5, 24.5, true};
  EXPECT_TRUE(IsNothingThere(ResolvePrompt(*model_, {view_, PointsPrompt{corner}}, {}).status()));
  ASSERT_OK_AND_ASSIGN(PromptedThing thing, Find({corner}));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, In(thing, view_));
  EXPECT_EQ(result.mask.pixels, Square(1, 6).pixels);
}

// The first positive click is answered first; each further one builds on the answer before it.
TEST_F(PromptedThingTest, FollowsFurtherClicks) {
  images_.first = {{left_, 0.8, {}}};
  images_.next = {both_, 0.7, {}};
  const PointPrompt no = {5.5, 5.5, false}, right = {kRightX + 0.5, kY + 0.5, true};
  ASSERT_OK_AND_ASSIGN(PromptedThing thing, Find({no, kLeft, right}));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, In(thing, view_));
  EXPECT_EQ(result.mask.pixels, both_.pixels);
  // The negative click is answered already.
  ASSERT_EQ(images_.asked.size(), 2U);
  EXPECT_EQ(images_.asked[0].size(), 1U);
  EXPECT_EQ(images_.asked[0][0].x, kLeft.x);
  ASSERT_EQ(images_.asked[1].size(), 3U);
  EXPECT_FALSE(images_.asked[1][1].positive);
  EXPECT_EQ(images_.asked[1].back().x, right.x);
  EXPECT_EQ(images_.befores, (std::vector<double>{-1, 0.8}));
}

TEST_F(PromptedThingTest, AnswersAllButTheLastEightTogether) {
  images_.first = {{left_, 0.8, {}}};
  images_.next = {left_, 0.7, {}};
  PointsPrompt clicks(11, kLeft);
  clicks.push_back({kRightX + 0.5, kY + 0.5, true});
  ASSERT_OK(Find(clicks));
  ASSERT_EQ(images_.asked.size(), 2U);
  EXPECT_EQ(images_.asked.front().size(), 4U);
  EXPECT_EQ(images_.asked.back().size(), 12U);
}

// The segmenter's mask has the upper half of the left blob, which no query of the model has. The
// other view, which shows the same, has about half, too; the model alone has all of it.
TEST_F(PromptedThingTest, FollowsTheMaskIntoOtherViews) {
  BinaryMask half = left_;
  for (int i = kY * kSize; i < kSize * kSize; ++i) half.pixels[i] = 0;
  images_.first = {{half, 0.8, {}}};
  ASSERT_OK_AND_ASSIGN(PromptedThing thing, Find({{kLeftX + 0.5, kY - 1.5, true}}));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, In(thing, other_));
  EXPECT_EQ(images_.refined, std::vector<std::string>{"other"});
  ASSERT_OK_AND_ASSIGN(const Query query,
                       ResolvePrompt(*model_, {view_, PointsPrompt{kLeft}}, {0.0, 0.75}));
  ASSERT_OK_AND_ASSIGN(const auto whole, model_->Segment(query, {&other_, 1}));
  EXPECT_GE(result.area, whole[0].area * 3 / 10);
  EXPECT_LE(result.area, whole[0].area * 7 / 10);
  const auto lower = result.mask.pixels.begin() + (kY + 2) * kSize;
  EXPECT_EQ(std::count(lower, result.mask.pixels.end(), 1), 0);
}

// A click takes the lower half of the left blob away. The other view has the change, and else
// exactly what the query gives there.
TEST_F(PromptedThingTest, TakesChangesToOtherViewsAndNothingElse) {
  BinaryMask upper = left_;
  for (int i = kY * kSize; i < kSize * kSize; ++i) upper.pixels[i] = 0;
  images_.next = {upper, 0.9, {}};
  for (int i = 0; i < 12 * kSize; ++i) images_.next.mask.pixels[i] = 1;  // is not connected
  ASSERT_OK_AND_ASSIGN(PromptedThing thing, Find({kLeft, {kLeftX + 0.5, kY + 1.5, false}}));
  ASSERT_OK_AND_ASSIGN(const SegmentResult own, In(thing, view_));
  EXPECT_EQ(own.mask.pixels, upper.pixels);
  ASSERT_OK_AND_ASSIGN(const SegmentResult there, In(thing, other_));
  const PromptedThing before = *Find({kLeft});
  ASSERT_OK_AND_ASSIGN(const SegmentResult whole,
                       PromptedThing(before).In(other_, {}, [] { return absl::OkStatus(); }));
  const int end = kY * kSize;
  EXPECT_TRUE(std::equal(whole.mask.pixels.begin(), whole.mask.pixels.begin() + end,
                         there.mask.pixels.begin()));
  const auto below = [&](const SegmentResult& of) {
    return std::count(of.mask.pixels.begin() + end, of.mask.pixels.end(), 1);
  };
  EXPECT_LT(2 * below(there), below(whole));  // but for pixels that the first view does not show
  EXPECT_GT(there.area, 0);
}

TEST_F(PromptedThingTest, TakesTheMaskThatFillsTheBox) {
  images_.first = {{Square(0, kSize), 0.95, {}}, {left_, 0.7, {}}, {Square(2, 6), 0.9, {}}};
  int box[4];
  FindBox(left_.pixels, kSize, box);
  const Prompt prompt = {view_,
                         BoxPrompt{double(box[0]), double(box[1]), double(box[2]), double(box[3])}};
  const auto go_on = [] { return absl::OkStatus(); };
  ASSERT_OK_AND_ASSIGN(PromptedThing thing,
                       PromptedThing::Find(*model_, &images_, prompt, {}, go_on));
  ASSERT_OK_AND_ASSIGN(const SegmentResult result, In(thing, view_));
  EXPECT_EQ(result.mask.pixels, left_.pixels);
  EXPECT_EQ(result.border_image, BorderImage::kRendering);
  EXPECT_GT(result.score, 0.5);
  ASSERT_OK_AND_ASSIGN(const SegmentResult there, In(thing, other_));
  EXPECT_GT(there.area, 0);
  EXPECT_EQ(images_.refined, std::vector<std::string>{"other"});
  // The segmenter sees nothing there: the model answers.
  images_.first = {{Square(0, 0), 0.9, {}}};
  ASSERT_OK_AND_ASSIGN(PromptedThing by_model,
                       PromptedThing::Find(*model_, &images_, prompt, {}, go_on));
  ASSERT_OK_AND_ASSIGN(const SegmentResult of_model, In(by_model, view_));
  EXPECT_EQ(of_model.border_image, BorderImage::kNone);
  EXPECT_GT(of_model.area, 0);
  const Prompt outside = {view_, BoxPrompt{-9, -9, 2, 2}};
  EXPECT_STATUS(PromptedThing::Find(*model_, &images_, outside, {}, go_on).status(),
                absl::StatusCode::kInvalidArgument, "outside");
}

TEST_F(PromptedThingTest, ReturnsErrors) {
  EXPECT_STATUS(Find({{-1, 5, true}}).status(), absl::StatusCode::kInvalidArgument, "outside");
  images_.first = {{BinaryMask{std::vector<uint8_t>(kSize * kSize)}, 0.8, {}}};
  EXPECT_TRUE(IsNothingThere(Find({{3.5, 24.5, true}}).status()));
  images_.error = absl::CancelledError("nobody waits");
  EXPECT_EQ(Find({kLeft}).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace pepeseg
