#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// Photographs and initial points from which almost nothing can be learned.

namespace pepeseg::testing {
namespace {

int NumPhotographSteps() { return FullStress() ? 5'000 : 500; }

class ExtremePhotographs : public BackendTest {
 protected:
  StageOneRun Learn(const char* what, const Capture& capture, const ReconstructOptions& options) {
    const auto run = RunStageOne(*backend_, capture, options);
    EXPECT_OK(run.status()) << what;
    if (!run.ok()) return {};
    ExpectAsMeasured(*backend_, std::string("photographs, ") + what, run->psnr);
    return *run;
  }
  StageOneRun Learn(const char* what, const Capture& capture) {
    return Learn(what, capture, TinyReconstruct(NumPhotographSteps()));
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, ExtremePhotographs, CpuAndCuda(), BackendName);

Capture Painted(uint8_t value) {
  Capture capture = TinyCapture();
  for (View& view : capture.views) std::ranges::fill(view.photo.pixels, value);
  return capture;
}

// In front of a black background no Gaussian is needed. Once all have faded, the stage reports it.
TEST_P(ExtremePhotographs, AllBlackFadesUntilNoGaussianIsLeft) {
  ReconstructOptions options = TinyReconstruct(NumPhotographSteps());
  options.prune_opacity = 0;
  Learn("black", Painted(0), options);
  options = TinyReconstruct(20'000);
  EXPECT_STATUS(RunStageOne(*backend_, Painted(0), options), absl::StatusCode::kFailedPrecondition,
                "density control left none");
}
TEST_P(ExtremePhotographs, AllWhiteTrains) { Learn("white", Painted(255)); }

// The same photograph from different positions, which no scene gives.
TEST_P(ExtremePhotographs, IdenticalOnesGiveFiniteNumbers) {
  Capture capture = TinyCapture();
  for (View& view : capture.views) view.photo = capture.views[0].photo;
  Learn("identical", capture);
}

TEST_P(ExtremePhotographs, NoiseGivesFiniteNumbers) {
  Capture capture = TinyCapture();
  std::mt19937_64 random(1);
  for (View& view : capture.views) {
    for (uint8_t& value : view.photo.pixels) value = static_cast<uint8_t>(random());
  }
  Learn("noise", capture);
}

TEST_P(ExtremePhotographs, AllIgnoredChangesNoColour) {
  Capture capture = TinyCapture();
  for (View& view : capture.views) {
    if (!view.held_out) view.ignore.assign(view.photo.pixels.size() / 3, 1);
  }
  ReconstructOptions options = TinyReconstruct(NumPhotographSteps());
  options.opacity_decay = 1;
  Learn("all ignored", capture, options);
}

TEST_P(ExtremePhotographs, OneGaussianTrains) {
  Capture capture = TinyCapture();
  capture.points.resize(1);
  ReconstructOptions options = TinyReconstruct(NumPhotographSteps());
  options.max_gaussians = 1;
  const StageOneRun run = Learn("one Gaussian", capture, options);
  EXPECT_EQ(run.gaussians.count, 1);
  EXPECT_LT(MeanOfLast(run.losses, 0.1), run.losses.front() - 0.05);
}

// All points are at one position: the distance to the nearest neighbour is 0.
TEST_P(ExtremePhotographs, CoincidentPointsTrain) {
  Capture capture = TinyCapture();
  for (ScenePoint& point : capture.points) point.position = capture.points[0].position;
  Learn("one spot", capture);
}

TEST_P(ExtremePhotographs, RandomPointsTrainIfThereAreNone) {
  Capture capture = TinyCapture();
  capture.points.clear();
  ReconstructOptions options = TinyReconstruct(NumPhotographSteps());
  options.num_random_points = 300;
  Learn("no points", capture, options);
}

}  // namespace
}  // namespace pepeseg::testing
