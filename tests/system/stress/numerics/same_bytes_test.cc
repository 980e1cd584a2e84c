#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/system/stress/numerics/tiny_runs.h"
#include "tests/testing/full_stress.h"
#include "tests/testing/status_testing.h"

// Runs with the same seed give the same bytes: on the CPU with any number of threads, and also on
// CUDA, since sums have a fixed order, and atomics only count integers or find their minimum or
// maximum (NUMERICS.md).

namespace pepeseg::testing {
namespace {

int NumRepeatedSteps() { return FullStress() ? 5'000 : 200; }
int NumRuns() { return FullStress() ? 5 : 2; }

Capture Scene() { return TinyCapture({.depth = DepthPrior::Kind::kDisparity}); }

// Options that use every part of stage one: local depth fits, refinement, coarse photographs.
ReconstructOptions Everything() {
  ReconstructOptions options = TinyReconstruct(NumRepeatedSteps());
  options.coarse_until = 0.2;
  options.refine_length = 0.1;
  options.refine_keep = RefineKeep::kSplit;
  return options;
}

struct Bytes {
  std::vector<float> planes, features, gate;
  std::vector<double> losses;
  bool operator==(const Bytes&) const = default;
};

Bytes Train(Backend& backend) {
  Bytes bytes;
  const Capture capture = Scene();
  const auto one = RunStageOne(backend, capture, Everything());
  EXPECT_OK(one.status());
  if (!one.ok()) return bytes;
  bytes.planes = one->gaussians.planes;
  bytes.losses = one->losses;
  const auto two = RunStageTwo(backend, capture, one->gaussians, TinyFeatures(NumRepeatedSteps()));
  EXPECT_OK(two.status());
  if (!two.ok()) return bytes;
  bytes.features = two->field.features;
  bytes.gate = {two->field.gate.begin(), two->field.gate.end()};
  bytes.losses.insert(bytes.losses.end(), two->losses.begin(), two->losses.end());
  return bytes;
}

TEST(SameBytes, ResultOnTheCpuWithAnyNumberOfThreads) {
  const Bytes want = Train(*MakeCpuBackend(1));
  ASSERT_FALSE(want.features.empty());
  for (const int num_threads : {1, 2, 3}) {
    EXPECT_TRUE(Train(*MakeCpuBackend(num_threads)) == want) << num_threads << " threads";
  }
}

class SameBytesOnADevice : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, SameBytesOnADevice, CpuAndCuda(), BackendName);

TEST_P(SameBytesOnADevice, ResultFromEachRun) {
  const Bytes want = Train(*backend_);
  ASSERT_FALSE(want.features.empty());
  double farthest = 0;
  for (int run = 1; run < NumRuns(); ++run) {
    const Bytes got = Train(*backend_);
    EXPECT_TRUE(got == want) << "run " << run;
    for (size_t i = 0; i < std::min(want.losses.size(), got.losses.size()); ++i) {
      farthest = std::max(farthest, std::abs(got.losses[i] - want.losses[i]));
    }
  }
  std::printf("spread of %d runs: losses differ by at most %g\n", NumRuns(), farthest);
}

// Without a depth loss, which allows one step at a time only.
TEST_P(SameBytesOnADevice, ResultOfStepsDoneAtOnce) {
  const Capture capture = TinyCapture();
  ReconstructOptions options = TinyReconstruct(NumRepeatedSteps());
  options.views_at_once = 4;
  ASSERT_OK_AND_ASSIGN(const StageOneRun want, RunStageOne(*backend_, capture, options));
  for (int run = 1; run < NumRuns(); ++run) {
    ASSERT_OK_AND_ASSIGN(const StageOneRun got, RunStageOne(*backend_, capture, options));
    EXPECT_EQ(got.gaussians.planes, want.gaussians.planes) << "run " << run;
    EXPECT_EQ(got.losses, want.losses) << "run " << run;
  }
}

}  // namespace
}  // namespace pepeseg::testing
