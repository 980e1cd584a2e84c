#include "core/correct/correct_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "core/query/resolve_prompt.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::Each;
using ::testing::Gt;

constexpr int kSize = 192;      // pixels, width and height of a view
constexpr double kFocal = 140;  // pixels
constexpr double kMiddle = 96;  // of a view, pixels
constexpr int kPerSide = 40;    // Gaussians along a square's side
constexpr float kFar = 3;       // distance of the squares from the cameras

// IoU of what is found of a square, whose borders are blurred by a pixel.
constexpr double kFound = 0.85;

absl::Status GoOn() { return absl::OkStatus(); }

// A row of three squares, 0.8 wide: the first two touch and have about the same feature, so that
// the model takes them for one thing; the third has another feature. Views "a", "b" and "c" see
// them from different places.
struct Squares : ::testing::Test {
  void SetUp() override {
    Model model;
    model.gaussians = Gaussians::Zero(3 * kPerSide * kPerSide, 0);
    model.field.features.assign(static_cast<size_t>(model.gaussians.count) * 32, 0.0f);
    for (int i = 0; i < 1000; ++i) model.field.scale_quantiles.push_back(0.001f * (i + 1));
    for (int square = 0; square < 3; ++square) AddSquare(square, model);
    for (const double x : {0.0, -0.4, 0.4}) {
      ModelView view;
      view.name = std::string(1, static_cast<char>('a' + model.views.size()));
      view.camera = {kSize, kSize, kFocal, kFocal, kMiddle, kMiddle};
      view.cam_from_world.translation.x() = x;
      model.views.push_back(view);
    }
    ASSERT_OK_AND_ASSIGN(segmenter, Segmenter::Create(*backend, std::move(model)));
  }

  static void AddSquare(int square, Model& model) {
    Gaussians& gaussians = model.gaussians;
    for (int i = 0; i < kPerSide * kPerSide; ++i) {
      const int64_t g = square * kPerSide * kPerSide + i;
      const float x = static_cast<float>(i % kPerSide), y = static_cast<float>(i / kPerSide);
      gaussians.Plane(kMeanPlane)[g] = -1.2f + 0.8f * (square + (x + 0.5f) / kPerSide);
      gaussians.Plane(kMeanPlane + 1)[g] = 0.8f * ((y + 0.5f) / kPerSide - 0.5f);
      gaussians.Plane(kMeanPlane + 2)[g] = kFar;
      for (int k = 0; k < 3; ++k) gaussians.Plane(kLogScalePlane + k)[g] = std::log(0.01f);
      gaussians.Plane(kRotationPlane)[g] = 1;
      gaussians.Plane(kOpacityPlane)[g] = 5;
      model.field.features[32 * g + (square == 2 ? 1 : 0)] = 1;
    }
  }

  const ModelView& View(int v) const { return segmenter->model().views[v]; }

  // The pixels of a square in a view.
  BinaryMask MaskOf(int view, int square) const {
    BinaryMask mask{std::vector<uint8_t>(size_t{kSize} * kSize)};
    const double shift = View(view).cam_from_world.translation.x();
    const auto column = [&](double x) { return kMiddle + kFocal * (x + shift) / kFar; };
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const bool across =
            x + 0.5 > column(-1.2 + 0.8 * square) && x + 0.5 < column(-1.2 + 0.8 * (square + 1));
        const bool down = std::abs(y + 0.5 - kMiddle) < 0.4 * kFocal / kFar;
        mask.pixels[y * kSize + x] = across && down ? 1 : 0;
      }
    }
    return mask;
  }
  Correction Of(int view, int square) const { return {View(view), MaskOf(view, square)}; }

  absl::StatusOr<CorrectedField> Correct(std::vector<Correction> corrections,
                                         std::optional<double> scale = std::nullopt) const {
    return CorrectField(*segmenter, corrections, scale, GoOn);
  }

  // IoU of a square in a view and the answer to a click on its middle, with this granularity.
  double IouOfClick(const Segmenter& of, int view, int square, const Granularity& granularity) {
    const BinaryMask truth = MaskOf(view, square);
    const double x =
        kMiddle + kFocal * (-0.8 + 0.8 * square + View(view).cam_from_world.translation.x()) / kFar;
    const PointsPrompt click = {{x, kMiddle + 0.5, true}};
    const auto query = ResolvePrompt(of, {View(view), click}, granularity);
    EXPECT_OK(query);
    const auto found = of.Segment(query.value_or(Query()), {&View(view), 1});
    EXPECT_OK(found);
    int64_t both = 0, either = 0;
    for (size_t p = 0; found.ok() && p < truth.pixels.size(); ++p) {
      const int inside = (*found)[0].mask.pixels[p], wanted = truth.pixels[p];
      both += inside & wanted, either += inside | wanted;
    }
    return either == 0 ? 0 : static_cast<double>(both) / static_cast<double>(either);
  }
  std::unique_ptr<Segmenter> Taught(FeatureField field) const {
    Model model = segmenter->model();
    model.field = std::move(field);
    return *Segmenter::Create(*backend, std::move(model));
  }

  std::unique_ptr<Backend> backend = MakeCpuBackend(2);
  std::unique_ptr<Segmenter> segmenter;
};

TEST_F(Squares, PartsWhatTheModelTookForOneThing) {
  EXPECT_LT(IouOfClick(*segmenter, 1, 0, {0.5, 0.75}), 0.6);
  ASSERT_OK_AND_ASSIGN(CorrectedField corrected, Correct({Of(0, 0)}));
  EXPECT_LT(corrected.iou_before[0], 0.6);
  EXPECT_GT(corrected.iou_after[0], kFound);
  EXPECT_GT(corrected.num_changed, kPerSide * kPerSide / 2);
  const auto taught = Taught(std::move(corrected.field));
  const Granularity at = {corrected.scale, corrected.threshold};
  for (const int view : {1, 2}) {
    EXPECT_GT(IouOfClick(*taught, view, 0, at), kFound) << "the corrected thing";
    EXPECT_GT(IouOfClick(*taught, view, 1, at), kFound) << "the thing that it was parted from";
    EXPECT_GT(IouOfClick(*taught, view, 2, at), kFound) << "another thing";
  }
}

TEST_F(Squares, LeavesOtherThingsGateAndScalesAsTheyWere) {
  const FeatureField& before = segmenter->model().field;
  ASSERT_OK_AND_ASSIGN(const CorrectedField corrected, Correct({Of(0, 0), Of(1, 0)}));
  const size_t third = size_t{2} * kPerSide * kPerSide * 32;
  EXPECT_TRUE(std::equal(before.features.begin() + third, before.features.end(),
                         corrected.field.features.begin() + third));
  EXPECT_EQ(corrected.field.gate, before.gate);
  EXPECT_EQ(corrected.field.scale_quantiles, before.scale_quantiles);
  EXPECT_EQ(corrected.iou_after.size(), 2u);
  EXPECT_THAT(corrected.iou_after, Each(Gt(kFound)));
}

TEST_F(Squares, JoinsWhatTheModelHasInParts) {
  BinaryMask both = MaskOf(0, 1);
  const BinaryMask other = MaskOf(0, 2);
  for (size_t p = 0; p < both.pixels.size(); ++p) both.pixels[p] |= other.pixels[p];
  ASSERT_OK_AND_ASSIGN(const CorrectedField corrected, Correct({{View(0), both}}));
  EXPECT_GT(corrected.iou_after[0], corrected.iou_before[0] + 0.2);
}

// At a third of the size, a pixel shows 11 Gaussians.
TEST_F(Squares, LearnsWhereManyGaussiansShareAPixel) {
  constexpr int kThird = kSize / 3;
  Correction small = Of(0, 0);
  small.view.camera = {kThird, kThird, kFocal / 3, kFocal / 3, kMiddle / 3, kMiddle / 3};
  const BinaryMask large = std::exchange(small.mask, {});
  for (int y = 0; y < kThird; ++y) {
    for (int x = 0; x < kThird; ++x) {
      small.mask.pixels.push_back(large.pixels[(3 * y + 1) * kSize + 3 * x + 1]);
    }
  }
  ASSERT_OK_AND_ASSIGN(CorrectedField corrected, Correct({small}));
  const auto taught = Taught(std::move(corrected.field));
  const Granularity at = {corrected.scale, corrected.threshold};
  // A pixel of the mask is three of the view, and a square is 37 wide.
  constexpr double kFoundCoarsely = 0.7;
  EXPECT_GT(IouOfClick(*taught, 1, 0, at), kFoundCoarsely);
  EXPECT_GT(IouOfClick(*taught, 1, 1, at), kFoundCoarsely);
}

TEST_F(Squares, IsTheSameEachTime) {
  ASSERT_OK_AND_ASSIGN(const CorrectedField first, Correct({Of(0, 0)}));
  ASSERT_OK_AND_ASSIGN(const CorrectedField second, Correct({Of(0, 0)}));
  EXPECT_EQ(first.field.features, second.field.features);
}

TEST_F(Squares, LearnsAtTheGivenScale) {
  ASSERT_OK_AND_ASSIGN(const CorrectedField corrected, Correct({Of(0, 0)}, 0.8));
  EXPECT_NEAR(corrected.scale, 0.8, 0.11);
}

TEST_F(Squares, RefusesMasksThatTeachNothing) {
  Correction empty = Of(0, 0), all = Of(0, 0), small = Of(0, 0);
  std::fill(empty.mask.pixels.begin(), empty.mask.pixels.end(), uint8_t{0});
  std::fill(all.mask.pixels.begin(), all.mask.pixels.end(), uint8_t{1});
  small.mask.pixels.resize(10);
  Correction corner = empty;
  std::fill(corner.mask.pixels.begin(), corner.mask.pixels.begin() + 5, uint8_t{1});
  EXPECT_STATUS(Correct({}), absl::StatusCode::kInvalidArgument, "1..16");
  EXPECT_STATUS(Correct({empty}), absl::StatusCode::kInvalidArgument, "");
  EXPECT_STATUS(Correct({small}), absl::StatusCode::kInvalidArgument, "");
  EXPECT_STATUS(Correct({all}), absl::StatusCode::kInvalidArgument, "covers all");
  EXPECT_STATUS(Correct({corner}), absl::StatusCode::kInvalidArgument, "nothing with a feature");
  EXPECT_STATUS(Correct({Of(0, 0), Of(0, 0)}), absl::StatusCode::kInvalidArgument, "named twice");
  EXPECT_STATUS(Correct({Of(0, 0)}, 1.5), absl::StatusCode::kInvalidArgument, "");
}

TEST_F(Squares, RefusesMasksOfDifferentThings) {
  const auto corrected = Correct({Of(0, 0), Of(1, 2)});
  EXPECT_STATUS(corrected, absl::StatusCode::kInvalidArgument, "contradicts the other masks");
}

TEST_F(Squares, RefusesAModelWithoutFeatures) {
  Model model = segmenter->model();
  model.field = {};
  ASSERT_OK_AND_ASSIGN(segmenter, Segmenter::Create(*backend, std::move(model)));
  EXPECT_STATUS(Correct({Of(0, 0)}), absl::StatusCode::kFailedPrecondition, "without masks");
}

TEST_F(Squares, EndsWithTheErrorOfItsCheck) {
  int calls = 0;
  const auto check = [&] {
    return ++calls == 2 ? absl::CancelledError("enough") : absl::OkStatus();
  };
  const std::vector<Correction> corrections = {Of(0, 0)};
  EXPECT_STATUS(CorrectField(*segmenter, corrections, std::nullopt, check),
                absl::StatusCode::kCancelled, "enough");
}

}  // namespace
}  // namespace pepeseg
