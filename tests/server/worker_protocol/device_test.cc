#include "server/worker_protocol/device.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  for (const char* wanted : {"", "gpu", "CPU", "cuda:", "cuda:-1", "cuda: 1", "cuda:+1", "cuda:1x",
                             "cuda1", "cuda:99999999999999999999", "cuda:1024", "autocuda"}) {
    EXPECT_EQ(OpenDevice(wanted, 1).status().code(), absl::StatusCode::kInvalidArgument) << wanted;
  }
}

}  // namespace
}  // namespace pepeseg
