#include <cmath>
#include <cstdio>

#include "tests/stress/full_stress.h"
#include "tests/stress/numerics/tiny_runs.h"
#include "tests/testing/status_testing.h"

// The same scene in other units, elsewhere, through other lenses, and in few or very many views:
// what the photographs show is the same, so what is learnt must be as good.

namespace pepeseg::testing {
namespace {

int NumSteps() { return FullStress() ? 3'000 : 400; }

class ExtremeScenes : public BackendTest {
 protected:
  // The held-out PSNR.
  double Learn(const char* what, const Capture& capture, int num_steps = NumSteps()) {
    const auto run = RunStageOne(*backend_, capture, TinyReconstruct(num_steps));
    EXPECT_OK(run.status()) << what;
    if (!run.ok()) return 0;
    std::printf("%s: held out %.2f dB, loss %.4f\n", what, run->psnr, MeanOfLast(run->losses, 0.1));
    return run->psnr;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, ExtremeScenes, CpuAndCuda(), BackendName);

Capture Scaled(Capture capture, double factor) {
  for (View& view : capture.views) view.cam_from_world.translation *= factor;
  for (ScenePoint& point : capture.points) point.position *= factor;
  return capture;
}

TEST_P(ExtremeScenes, UnitsChangeNothing) {
  const Capture capture = TinyCapture();
  const double metres = Learn("unit 1", capture);
  EXPECT_GT(metres, 20);
  EXPECT_NEAR(Learn("unit 1e-6", Scaled(capture, 1e6)), metres, 1);
  EXPECT_NEAR(Learn("unit 1e6", Scaled(capture, 1e-6)), metres, 1);
}

// Objects as large in the pictures as before: the longer the lens, the farther away it stands.
Capture SeenFromAfar(Capture capture, double focal) {
  const Eigen::Vector3d target = {0, -0.3, 0};
  for (View& view : capture.views) {
    const double times = focal / view.camera.fx;
    const Pose& pose = view.cam_from_world;
    view.camera.fx = view.camera.fy = focal;
    view.cam_from_world.translation.z() += (times - 1) * (pose * target).z();
  }
  return capture;
}

TEST_P(ExtremeScenes, LongLensesFromAfarChangeLittle) {
  const double near = Learn("focal 35", TinyCapture());
  for (const double focal : {1e3, 1e4, 1e5}) {
    EXPECT_GT(Learn("from afar", SeenFromAfar(TinyCapture(), focal)), near - 3) << focal;
  }
}

// The same places, other lenses: at 10 most of the picture is guessed, at 1e5 a view sees a
// thousandth of a ball.
TEST_P(ExtremeScenes, AnyFocalLengthGivesNumbers) {
  for (const double focal : {10.0, 1e3, 1e5}) {
    Capture capture = TinyCapture();
    for (View& view : capture.views) view.camera.fx = view.camera.fy = focal;
    Learn("zoomed in place", capture);
  }
}

// Half of the views on one side of the other's middle.
TEST_P(ExtremeScenes, OneViewIsLearnt) {
  Capture capture = TinyCapture();
  capture.views = {capture.views[1]};
  ASSERT_OK_AND_ASSIGN(const StageOneRun run,
                       RunStageOne(*backend_, capture, TinyReconstruct(NumSteps())));
  std::printf("one view: PSNR %.2f dB\n", run.last.psnr);
  EXPECT_GT(run.last.psnr, 22);
}

// A camera on a tripod that turns a little from view to view.
TEST_P(ExtremeScenes, CamerasThatAllStandAtOnePlaceAreLearnt) {
  Capture capture = TinyCapture();
  const View first = capture.views[1];
  const Eigen::Vector3d eye = first.cam_from_world.Inverse().translation;
  for (View& view : capture.views) {
    view.photo = first.photo;
    view.cam_from_world = first.cam_from_world;
    view.cam_from_world.translation = -(view.cam_from_world.rotation * eye);
  }
  EXPECT_GT(Learn("one place", capture), 22);
}

TEST_P(ExtremeScenes, TenThousandViewsAreLearnt) {
  const int num_views = FullStress() ? 10'000 : 1'000;
  Capture capture = TinyCapture({.num_views = num_views, .side = 16, .held_out_every = 8});
  EXPECT_GT(Learn("many views", capture, FullStress() ? 10'000 : 400), 17);
}

}  // namespace
}  // namespace pepeseg::testing
