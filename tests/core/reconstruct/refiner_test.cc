#include "core/reconstruct/refiner.h"

#include <cmath>

#include "core/scene/camera.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

// Returns views from the origin along z with 100 x 40 pixels, 50 a scene unit at z = 2. Each but
// the last has a mask of x < 60.
Capture FrontViews(int num_views) {
  Capture capture;
  BinaryMask left;
  for (int i = 0; i < 100 * 40; ++i) left.pixels.push_back(i % 100 < 60 ? 1 : 0);
  for (int i = 0; i < num_views; ++i) {
    View view;
    view.camera = {100, 40, 100, 100, 50, 20.5};
    if (i + 1 < num_views) view.masks = BuildMaskSet(100, 40, {&left, 1});
    capture.views.push_back(view);
  }
  return capture;
}

// Returns Gaussians that are long in x, from pixel 20 to 80.
Gaussians Needles(int64_t count) {
  Gaussians out = Gaussians::Zero(count, 0);
  for (int64_t i = 0; i < count; ++i) {
    out.Plane(kMeanPlane + 2)[i] = 2;
    out.Plane(kLogScalePlane)[i] = std::log(0.2f);
    for (int k = 1; k < 3; ++k) out.Plane(kLogScalePlane + k)[i] = std::log(0.002f);
    out.Plane(kRotationPlane)[i] = 1;
    out.Plane(kOpacityPlane)[i] = 2;
    out.Plane(kShPlane)[i] = static_cast<float>(i);
  }
  return out;
}

struct Fixture {
  explicit Fixture(const ReconstructOptions& options_in, int num_views = 3, int64_t count = 20)
      : options(options_in),
        backend(MakeCpuBackend(2)),
        capture(FrontViews(num_views)),
        refiner(*backend, capture, options, Schedule(options, 1)),
        state(*backend, Needles(count)) {}

  absl::Status Apply(int view) {
    const View& at = capture.views[static_cast<size_t>(view)];
    return refiner.Apply({view, ToPinholeView(at.camera, at.cam_from_world), 0.01f}, state);
  }
  std::vector<int> DueSteps() const {
    std::vector<int> due;
    for (int step = 0; step < options.num_steps; ++step) {
      if (refiner.Due(step)) due.push_back(step);
    }
    return due;
  }

  ReconstructOptions options;
  std::unique_ptr<Backend> backend;
  Capture capture;
  Refiner refiner;
  GaussianState state;
};

ReconstructOptions WithKeep(RefineKeep keep) {
  ReconstructOptions options;
  options.num_steps = 30000;
  options.refine_keep = keep;
  return options;
}

TEST(Refiner, VisitsEachViewTwiceFromItsShareOn) {
  const std::vector<int> due = Fixture(WithKeep(RefineKeep::kShrink)).DueSteps();
  EXPECT_THAT(due, ::testing::ElementsAre(4000, 4001, 4002, 4003, 4004, 4005));
}

TEST(Refiner, ScalesItsWindowWithTheRun) {
  ReconstructOptions options = WithKeep(RefineKeep::kShrink);
  const auto many = Fixture(options, 150).DueSteps();
  ASSERT_EQ(many.size(), 200u);
  EXPECT_EQ(many.front(), 4000);
  options.num_steps = 3000;
  const auto few = Fixture(options, 150).DueSteps();
  ASSERT_EQ(few.size(), 20u);
  EXPECT_EQ(few.front(), 400);
}

TEST(Refiner, DelaysItsWindowUntilPhotographsHaveFullSize) {
  ReconstructOptions options = WithKeep(RefineKeep::kShrink);
  options.num_steps = 3000;
  options.coarse_until = 0.4;
  EXPECT_EQ(Fixture(options, 150).DueSteps().front(), 1200);
}

TEST(Refiner, IsNeverDueWithoutMasksOrWhenOff) {
  EXPECT_THAT(Fixture(WithKeep(RefineKeep::kShrink), 1).DueSteps(), ::testing::IsEmpty());
  EXPECT_THAT(Fixture(WithKeep(RefineKeep::kNone)).DueSteps(), ::testing::IsEmpty());
}

TEST(Refiner, ShortensAShareOfTheGaussiansOfEachViewOnce) {
  Fixture it(WithKeep(RefineKeep::kShrink));
  ASSERT_OK(it.Apply(0));
  EXPECT_EQ(it.refiner.counts().num_refined, 2);  // a tenth of 20
  ASSERT_OK(it.Apply(1));
  EXPECT_EQ(it.refiner.counts().num_refined, 3);  // a tenth of the 18 that are left
  ASSERT_OK(it.Apply(2));                         // has no masks
  EXPECT_EQ(it.refiner.counts().num_refined, 3);
  EXPECT_EQ(it.refiner.counts().num_split, 0);
  const Gaussians after = it.state.Download();
  for (int i = 0; i < 20; ++i) {
    EXPECT_NEAR(std::exp(after.Plane(kLogScalePlane)[i]), i < 3 ? 0.4f / 3 : 0.2f, 1e-5f) << i;
  }
}

TEST(Refiner, AppendsTheOutsidePartsWhenSplitting) {
  ReconstructOptions options = WithKeep(RefineKeep::kSplit);
  options.refine_candidates = 0.2;
  Fixture it(options);
  ASSERT_OK(it.Apply(0));
  EXPECT_EQ(it.refiner.counts().num_refined, 4);
  EXPECT_EQ(it.refiner.counts().num_split, 4);
  const Gaussians after = it.state.Download();
  ASSERT_EQ(after.count, 24);
  for (int i = 0; i < 4; ++i) {
    EXPECT_NEAR(after.Plane(kMeanPlane)[i], -0.2f, 1e-5f);
    EXPECT_NEAR(after.Plane(kMeanPlane)[20 + i], 0.4f, 1e-5f);
    EXPECT_NEAR(std::exp(after.Plane(kLogScalePlane)[20 + i]), 0.2f / 3, 1e-5f);
    EXPECT_EQ(after.Plane(kShPlane)[20 + i], static_cast<float>(i));
    EXPECT_EQ(it.state.refinable()[i], 0);
    EXPECT_EQ(it.state.refinable()[20 + i], 0);
  }
}

TEST(Refiner, KeepsToTheLimitOfGaussiansWhenSplitting) {
  ReconstructOptions options = WithKeep(RefineKeep::kSplit);
  options.refine_candidates = 0.5;
  options.max_gaussians = 23;
  Fixture it(options);
  ASSERT_OK(it.Apply(0));
  EXPECT_EQ(it.refiner.counts().num_refined, 10);
  EXPECT_EQ(it.refiner.counts().num_split, 3);
  ASSERT_OK(it.Apply(1));
  EXPECT_EQ(it.state.count(), 23);
  EXPECT_EQ(it.refiner.counts().num_refined, 15);
}

TEST(Refiner, SkipsGaussiansAddedAfterTheWindowOpened) {
  ReconstructOptions options = WithKeep(RefineKeep::kShrink);
  options.refine_candidates = 1;
  Fixture it(options, 3, 4);
  ASSERT_OK(it.Apply(2));  // opens the window
  const Buffer<int32_t> source(*it.backend, std::vector<int32_t>{3, 0, 0, 2, 1});
  const Buffer<uint8_t> is_new(*it.backend, std::vector<uint8_t>{0, 1, 0, 1, 0});
  ASSERT_TRUE(it.state.Rearrange(source.span(), is_new.span()));
  ASSERT_OK(it.Apply(0));
  EXPECT_EQ(it.refiner.counts().num_refined, 3);
  const Gaussians after = it.state.Download();
  const bool want[] = {true, false, true, false, true};
  for (int i = 0; i < 5; ++i) EXPECT_EQ(after.Plane(kMeanPlane)[i] != 0, want[i]) << i;
}

TEST(Refiner, FreesItsMemoryWhenTheWindowEnds) {
  Fixture it(WithKeep(RefineKeep::kShrink));
  const size_t before = it.backend->bytes_in_use();
  ASSERT_OK(it.Apply(0));
  it.refiner.EndStep(4000, it.state);
  EXPECT_GT(it.backend->bytes_in_use(), before);
  it.refiner.EndStep(4005, it.state);
  EXPECT_LT(it.backend->bytes_in_use(), before);  // the masks too
  EXPECT_FALSE(it.refiner.Due(4005));
  EXPECT_EQ(it.refiner.counts().num_refined, 2);
}

TEST(ViewMasks, HoldsTheMaskCellsOfTheTrainingViews) {
  Capture capture;
  capture.views.resize(3);
  capture.views[0].held_out = true;
  const std::vector<BinaryMask> masks = {{{1, 1, 0, 0}}, {{0, 1, 1, 0}}};
  capture.views[0].masks = capture.views[2].masks = BuildMaskSet(2, 2, masks);
  const auto backend = MakeCpuBackend(1);
  const ViewMasks view_masks(*backend, capture);
  EXPECT_TRUE(view_masks.any());
  EXPECT_TRUE(view_masks.allocated());
  EXPECT_FALSE(view_masks.HasMasks(0));
  ASSERT_TRUE(view_masks.HasMasks(1));
  const PatchMap map = view_masks.At(1);
  EXPECT_EQ(map.words, 1);
  const uint64_t want[] = {0b01, 0b11, 0b10, 0};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(map.cell_bits[map.pixel_cell[i]], want[i]);
  EXPECT_EQ(map.mask_area[0], 2);
  EXPECT_EQ(map.mask_area[1], 2);
}

TEST(ViewMasks, ReportsThatThereAreNone) {
  Capture capture;
  capture.views.resize(2);
  const auto backend = MakeCpuBackend(1);
  EXPECT_FALSE(ViewMasks(*backend, capture).any());
}

}  // namespace
}  // namespace pepeseg
