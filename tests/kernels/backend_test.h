#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>

#include "kernels/backend.h"

namespace pepeseg {

// A test that runs on every backend: TEST_P(RenderTest, Fact) with
// INSTANTIATE_TEST_SUITE_P(Backends, RenderTest, AllBackends(), BackendName).
struct BackendCase {
  const char* name;
  std::unique_ptr<Backend> (*make)();  // nullptr where this machine lacks the device
};

// The CPU with each of its instruction sets.
std::unique_ptr<Backend> MakeCpuAvx3();
std::unique_ptr<Backend> MakeCpuAvx2();
std::unique_ptr<Backend> MakeCpuSse4();
// nullptr without a device; with PEPESEG_REQUIRE_CUDA=1 in the environment that is a failure.
std::unique_ptr<Backend> MakeCuda();

class BackendTest : public ::testing::TestWithParam<BackendCase> {
 protected:
  void SetUp() override {
    backend_ = GetParam().make();
    if (backend_ != nullptr) return;
    if (HasFailure()) FAIL();  // a test that has failed is not skipped: its body would run
    GTEST_SKIP() << "this machine has no " << GetParam().name;
  }

  void TearDown() override {
    if (backend_ == nullptr) return;
    backend_->Sync();
    EXPECT_EQ(backend_->error(), "");
  }

  std::unique_ptr<Backend> backend_;
};

// The CUDA backend beside the CPU's; skipped without a device.
class CudaAndCpuTest : public ::testing::Test {
 protected:
  void SetUp() override {
    cpu_ = MakeCpuBackend(0);
    cuda_ = MakeCuda();
    if (cuda_ != nullptr) return;
    if (HasFailure()) FAIL();
    GTEST_SKIP() << "this machine has no Cuda";
  }
  void TearDown() override {
    if (cuda_ == nullptr) return;
    cuda_->Sync();
    EXPECT_EQ(cuda_->error(), "");
  }

  std::unique_ptr<Backend> cpu_, cuda_;
};

inline auto AllBackends() {
  return ::testing::Values(BackendCase{"CpuAvx3", MakeCpuAvx3}, BackendCase{"CpuAvx2", MakeCpuAvx2},
                           BackendCase{"CpuSse4", MakeCpuSse4}, BackendCase{"Cuda", MakeCuda});
}

inline std::string BackendName(const ::testing::TestParamInfo<BackendCase>& info) {
  return info.param.name;
}

}  // namespace pepeseg
