// Makes each allocation of a training step, of row queries and of clustering fail in turn, and all
// after it. The backend must keep the error and write nowhere without memory.
#include <gtest/gtest.h>

#include <vector>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/rendered.h"
#include "tests/testing/failing_allocations.h"

namespace pepeseg {
namespace {

void CaptureAndTranspose(Backend& backend, Rendered& scene) {
  Buffer<int32_t> first, gaussian, by_gaussian, by_gaussian_first, pixel;
  Buffer<float> weight, pixel_weight;
  const std::vector<int32_t> pixels = {0, 50, 500};
  const Buffer<int32_t> wanted(backend, std::span<const int32_t>(pixels));
  CaptureRowsArgs capture;
  capture.pixels = wanted.span();
  capture.scratch = &scene.scratch;
  capture.row_first = &first;
  capture.entry_gaussian = &gaussian;
  capture.entry_weight = &weight;
  backend.CaptureRows(capture);
  TransposeRowsArgs transpose;
  transpose.rows = {first.span(), gaussian.span(), weight.span()};
  transpose.num_gaussians = scene.host.count;
  transpose.gaussian = &by_gaussian;
  transpose.first = &by_gaussian_first;
  transpose.pixel = &pixel;
  transpose.weight = &pixel_weight;
  backend.TransposeRows(transpose);
}

void JoinPoints(Backend& backend) {
  const Buffer<float> points = Upload(backend, RandomValues(40 * kFeatureSize, 1));
  Buffer<float> core(backend, 40);
  Buffer<TreeEdge> edges(backend, 39);
  if (!backend.error().empty()) return;
  backend.SpanningTree({points.span(), 5, core.span(), edges.span()});
}

void UseEveryOpThatAllocates(Backend& backend) {
  Rendered scene(backend, RandomScene({.count = 300}), TestView(40, 30));
  scene.Render();
  scene.Backward(std::vector<float>(3 * 40 * 30, 1.0f));
  scene.ParameterGradient();
  UpdateArgs update = scene.MakeUpdateArgs();
  backend.Update(update);
  Rendered other(backend, scene.host, TestView(30, 40));
  other.Render();
  other.Backward(std::vector<float>(3 * 40 * 30, 1.0f));
  const UpdateStep steps[] = {scene.step, {.view = other.view, .scratch = &other.scratch}};
  update.steps = steps;
  backend.Update(update);
  CaptureAndTranspose(backend, scene);
  JoinPoints(backend);
}

TEST(OutOfMemoryTest, KeepsTheErrorAndWritesNothing) {
  for (int allowed = 0;; ++allowed) {
    SCOPED_TRACE(allowed);
    ASSERT_LT(allowed, 1000) << "the last allocation was never reached";
    const std::unique_ptr<Backend> backend = MakeCpuBackend(2);
    allocations_left = allowed;
    UseEveryOpThatAllocates(*backend);
    const bool was_enough = allocations_left > 0;
    allocations_left = kUnlimited;
    if (was_enough) {
      EXPECT_EQ(backend->error(), "");
      EXPECT_GT(allowed, 20);
      break;
    }
    // No error if the last allocation that was allowed was the last one needed.
    if (backend->error().empty()) continue;
    EXPECT_NE(backend->error().find("out of memory"), std::string::npos) << backend->error();
    EXPECT_EQ(backend->bytes_in_use(), 0u);
    const BackendError taken = backend->TakeError();
    EXPECT_NE(taken.what.find("out of memory"), std::string::npos) << taken.what;
    EXPECT_FALSE(taken.fatal);
    EXPECT_EQ(backend->error(), "");
    UseEveryOpThatAllocates(*backend);
    EXPECT_EQ(backend->TakeError().what, "");
  }
}

TEST(OutOfMemoryTest, KeepsAFatalError) {
  const std::unique_ptr<Backend> backend = MakeCpuBackend(1);
  Rendered scene(*backend, RandomScene({.count = 30}), TestView(40, 30));
  scene.Render();
  scene.scratch.for_backward = false;
  scene.Backward(std::vector<float>(3 * 40 * 30, 1.0f));
  for (int i = 0; i < 2; ++i) {
    const BackendError error = backend->TakeError();
    EXPECT_TRUE(error.fatal);
    EXPECT_NE(error.what.find("RenderBackward"), std::string::npos) << error.what;
  }
  EXPECT_NE(backend->error(), "");
}

}  // namespace
}  // namespace pepeseg
