#include "server/server_parts.h"

#include <gtest/gtest.h>

#include "kernels/host_memory.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

constexpr int64_t kGib = int64_t{1} << 30;

TEST(WorkerMemory, IsTheRestAfterModelsAndReserve) {
  EXPECT_EQ(WorkerMemory(16 * kGib, 8 * kGib), 7 * kGib);
  EXPECT_EQ(WorkerMemory(4 * kGib, 2 * kGib), 3 * kGib / 2);
}

TEST(WorkerMemory, IsAtLeastAQuarter) {
  EXPECT_EQ(WorkerMemory(16 * kGib, 15 * kGib), 4 * kGib);
  EXPECT_EQ(WorkerMemory(16 * kGib, int64_t{1} << 50), 4 * kGib);
}

TEST(WorkerMemory, IsUnlimitedIfSlurmStartsWorkers) {
  ServerOptions options;
  options.model_bytes = kGib;
  const int64_t here = WorkerMemory(options, 1);
  EXPECT_GT(here, 0);
  EXPECT_LT(here, HostMemory().total_bytes);
  options.launch.launcher = LaunchOptions::Launcher::kSlurm;
  EXPECT_EQ(WorkerMemory(options, 1), 0);
}

TEST(WorkerMemory, IsDividedAmongTheDevices) {
  ServerOptions options;
  EXPECT_EQ(WorkerMemory(options, 4), WorkerMemory(options, 1) / 4);
}

TEST(TrainingMemory, IsAtMostWorkerMemoryOnTheHost) {
  ASSERT_OK_AND_ASSIGN(const auto device, OpenDevice("cpu", 1));
  ServerOptions options;
  options.device_memory = int64_t{1} << 50;
  for (const size_t num_devices : {1, 2}) {
    EXPECT_EQ(TrainingMemory(options, *device.backend, num_devices),
              WorkerMemory(options, num_devices));
  }
  options.device_memory = kGib / 8;
  EXPECT_EQ(TrainingMemory(options, *device.backend, 2), kGib / 8);
}

}  // namespace
}  // namespace pepeseg
