#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "core/scene/camera.h"
#include "tests/system/stress/numerics/measured.h"
#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// The same scene in other units, at another position, with other focal lengths, and in few or very
// many views. The photographs show the same, so the result must be as good.

namespace pepeseg::testing {
namespace {

int NumSceneSteps() { return FullStress() ? 3'000 : 400; }

class ExtremeScenes : public BackendTest {
 protected:
  // Returns the PSNR of held-out views, dB.
  double Learn(const char* what, const Capture& capture, int num_steps = NumSceneSteps()) {
    const auto run = RunStageOne(*backend_, capture, TinyReconstruct(num_steps));
    EXPECT_OK(run.status()) << what;
    if (!run.ok()) return 0;
    ExpectAsMeasured(*backend_, std::string("scene, ") + what, run->psnr);
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
  EXPECT_NEAR(Learn("unit 1e-6", Scaled(capture, 1e6)), metres, 1);
  EXPECT_NEAR(Learn("unit 1e6", Scaled(capture, 1e-6)), metres, 1);
}

// Single precision has seven digits. `relative`: to an origin, as an import makes it.
Capture FarFromZero(Capture capture, bool relative) {
  const Eigen::Vector3d far(6e6, 8e6, -3e6);
  std::vector<Pose> poses;
  for (View& view : capture.views) {
    poses.push_back(InWorld(far, view.cam_from_world));
    view.cam_from_world = poses.back();
  }
  const Eigen::Vector3d origin = relative ? OriginOf(poses) : Eigen::Vector3d::Zero();
  for (View& view : capture.views) view.cam_from_world = RelativeTo(origin, view.cam_from_world);
  for (ScenePoint& point : capture.points) {
    point.position = (point.position.cast<double>() + far - origin).cast<float>();
  }
  return capture;
}

TEST_P(ExtremeScenes, FarFromZeroTrainRelativeToAnOrigin) {
  const double near = Learn("at zero", TinyCapture());
  EXPECT_LT(Learn("ten millions away", FarFromZero(TinyCapture(), false)), near - 3);
  EXPECT_GT(Learn("relative to the origin", FarFromZero(TinyCapture(), true)), near - 1);
}

// The objects keep their size in the photographs: with a longer focal length the camera is farther
// away.
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

// From far away all rays of a view are parallel, so a distance of 100,000 is like one of 1,000.
// Compared with a near view some accuracy is lost, since parallel rays contain less depth
// information.
TEST_P(ExtremeScenes, LongFocalLengthsFromAfarChangeLittle) {
  const double near = Learn("focal 35", TinyCapture());
  const double parallel = Learn("focal 1e3", SeenFromAfar(TinyCapture(), 1e3));
  EXPECT_GT(parallel, near - 3);
  EXPECT_GT(Learn("focal 1e4", SeenFromAfar(TinyCapture(), 1e4)), parallel - 1.5);
  EXPECT_GT(Learn("focal 1e5", SeenFromAfar(TinyCapture(), 1e5)), parallel - 1.5);
}

// The same camera positions with other focal lengths. At 10 no view determines most of the picture;
// at 1e5 a view sees a thousandth of a ball.
TEST_P(ExtremeScenes, AnyFocalLengthGivesFiniteNumbers) {
  for (const double focal : {10.0, 1e3, 1e5}) {
    Capture capture = TinyCapture();
    for (View& view : capture.views) view.camera.fx = view.camera.fy = focal;
    Learn(focal == 10    ? "zoomed in place, 10"
          : focal == 1e3 ? "zoomed in place, 1e3"
                         : "zoomed in place, 1e5",
          capture);
  }
}

float LargestMove(const StageOneRun& run, const Capture& capture) {
  float largest = 0;
  for (int64_t i = 0; i < run.gaussians.count; ++i) {
    float nearest = std::numeric_limits<float>::infinity();
    for (const ScenePoint& point : capture.points) {
      const Eigen::Vector3f mean(run.gaussians.Plane(kMeanPlane)[i],
                                 run.gaussians.Plane(kMeanPlane + 1)[i],
                                 run.gaussians.Plane(kMeanPlane + 2)[i]);
      nearest = std::min(nearest, (mean - point.position).norm());
    }
    largest = std::max(largest, nearest);
  }
  return largest;
}

// One camera centre does not give the size of the scene. The means must still move.
TEST_P(ExtremeScenes, OneViewTrains) {
  Capture capture = TinyCapture();
  capture.views = {capture.views[1]};
  ASSERT_OK_AND_ASSIGN(const StageOneRun run,
                       RunStageOne(*backend_, capture, TinyReconstruct(NumSceneSteps())));
  ExpectAsMeasured(*backend_, "scene, one view", run.last.psnr);
  EXPECT_GT(LargestMove(run, capture), 0.05);
}

// A camera on a tripod rotates a little from view to view.
TEST_P(ExtremeScenes, CoincidentCamerasTrain) {
  Capture capture = TinyCapture();
  const View first = capture.views[1];
  const Eigen::Vector3d eye = first.cam_from_world.Inverse().translation;
  for (View& view : capture.views) {
    view.photo = first.photo;
    view.cam_from_world = first.cam_from_world;
    view.cam_from_world.translation = -(view.cam_from_world.rotation * eye);
  }
  Learn("one place", capture);
}

TEST_P(ExtremeScenes, TenThousandViewsTrain) {
  const int num_views = FullStress() ? 10'000 : 1'000;
  Capture capture = TinyCapture({.num_views = num_views, .side = 16, .held_out_every = 8});
  Learn("many views", capture, FullStress() ? 10'000 : 400);
}

}  // namespace
}  // namespace pepeseg::testing
