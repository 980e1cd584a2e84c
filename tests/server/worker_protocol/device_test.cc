#include "server/worker_protocol/device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// Returns the reason why this build has no CUDA on this machine. Empty: it has.
std::string CudaError() {
  std::string error;
  MakeCudaBackend({}, &error);
  return error;
}

TEST(Device, OpensTheCpuByName) {
  ASSERT_OK_AND_ASSIGN(const auto device, OpenDevice("cpu", 3));
  EXPECT_EQ(device.id, "cpu");
  EXPECT_EQ(device.reason, "");
  EXPECT_THAT(device.backend->name(), StartsWith("cpu (3 threads"));
}

TEST(Device, OpensLogicalCpus) {
  ASSERT_OK_AND_ASSIGN(const auto plain, OpenDevice("cpu", 2));
  ASSERT_OK_AND_ASSIGN(const auto device, OpenDevice("cpu:1", 2));
  EXPECT_EQ(device.id, "cpu:1");
  EXPECT_THAT(device.name, StartsWith("cpu 1 (2 threads"));
  EXPECT_EQ(plain.name, plain.backend->name());
  EXPECT_EQ(KindOfDevice(device.name), plain.name);
  EXPECT_EQ(CudaDevice(device.id), std::nullopt);
}

TEST(Device, KindLeavesOutTheNumbers) {
  EXPECT_EQ(KindOfDevice("cuda 0 (NVIDIA H200)"), "cuda (NVIDIA H200)");
  EXPECT_EQ(KindOfDevice("cuda 1#2 (NVIDIA H200)"), "cuda (NVIDIA H200)");
  EXPECT_EQ(KindOfDevice(""), "");
  EXPECT_EQ(CudaDevice("cuda:3#1"), 3);
}

TEST(Devices, OpenInTheOrderOfTheList) {
  ASSERT_OK_AND_ASSIGN(const auto devices, OpenDevices("cpu:1,cpu,cpu:0", 3));
  ASSERT_EQ(devices.size(), 3u);
  EXPECT_EQ(devices[0].id, "cpu:1");
  EXPECT_EQ(devices[1].id, "cpu");
  EXPECT_EQ(devices[2].id, "cpu:0");
  for (const Device& device : devices) {
    EXPECT_THAT(device.backend->name(), StartsWith("cpu (3 threads"));
  }
}

TEST(Devices, ShareTheCores) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  EXPECT_EQ(ThreadsOfDevice(0, 1), 0);
  EXPECT_EQ(ThreadsOfDevice(0, 2), std::max(1, cores / 2));
  EXPECT_EQ(ThreadsOfDevice(0, 4 * cores), 1);
  EXPECT_EQ(ThreadsOfDevice(3, 2), 3);
}

TEST(Devices, AllAreTheCpuWithoutCuda) {
  ASSERT_OK_AND_ASSIGN(const auto devices, OpenDevices("all", 1));
  EXPECT_EQ(devices[0].id, CudaError().empty() ? "cuda:0" : "cpu");
  EXPECT_EQ(devices[0].reason, CudaError());
}

TEST(Devices, RefuseListsWithErrors) {
  for (const char* list : {"", "cpu,", "cpu,cpu", "cpu:0,cpu:0", "cuda,cuda:0", "auto,cpu:1",
                           "cpu,all", "cpu, cpu:1"}) {
    EXPECT_EQ(OpenDevices(list, 1).status().code(), absl::StatusCode::kInvalidArgument) << list;
  }
}

TEST(Device, OpensCudaOrReportsWhyNotForAuto) {
  ASSERT_OK_AND_ASSIGN(const auto device, OpenDevice("auto", 1));
  EXPECT_EQ(device.reason, CudaError());
  EXPECT_EQ(device.id, device.reason.empty() ? "cuda:0" : "cpu");
  EXPECT_THAT(device.backend->name(), StartsWith(device.reason.empty() ? "cuda 0" : "cpu (1"));
}

TEST(Device, OpensAgainByItsId) {
  ASSERT_OK_AND_ASSIGN(const auto first, OpenDevice("auto", 1));
  ASSERT_OK_AND_ASSIGN(const auto second, OpenDevice(first.id, 1));
  EXPECT_EQ(second.id, first.id);
  EXPECT_EQ(second.backend->name(), first.backend->name());
}

TEST(Device, RefusesMissingCudaWithTheReason) {
  const std::string error = CudaError();
  for (const char* wanted : {"cuda", "cuda:0", "cuda:999"}) {
    const auto device = OpenDevice(wanted, 1);
    if (error.empty() && std::string(wanted) != "cuda:999") {
      EXPECT_OK(device);
      continue;
    }
    EXPECT_EQ(device.status().code(), absl::StatusCode::kFailedPrecondition) << wanted;
    EXPECT_THAT(std::string(device.status().message()), HasSubstr(error.empty() ? "999" : error));
  }
}

TEST(Device, RefusesOtherWords) {
  for (const char* wanted :
       {"",          "gpu",      "CPU",      "cuda:",  "cuda:-1",
        "cuda: 1",   "cuda:+1",  "cuda:1x",  "cuda1",  "cuda:99999999999999999999",
        "cuda:1024", "autocuda", "cpu:",     "cpu:-1", "cpu:x",
        "cpu:0#1",   "cuda:0#",  "cuda:0#x", "cuda#1", "cpux"}) {
    EXPECT_EQ(OpenDevice(wanted, 1).status().code(), absl::StatusCode::kInvalidArgument) << wanted;
  }
}

}  // namespace
}  // namespace pepeseg
