#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>

#include "kernels/backend.h"

namespace pepeseg {

// A backend that tests run on. For a test on every backend write TEST_P(RenderTest, DoesThis) and
// INSTANTIATE_TEST_SUITE_P(Backends, RenderTest, AllBackends(), BackendName).
struct BackendCase {
  const char* name;
  std::unique_ptr<Backend> (*make)();  // returns nullptr if this machine lacks it
};

// Make the CPU backend with one instruction set; nullptr if this machine lacks it.
std::unique_ptr<Backend> MakeCpuAvx3();
std::unique_ptr<Backend> MakeCpuVnni();  // AVX-512 with VNNI
std::unique_ptr<Backend> MakeCpuAvx2();
std::unique_ptr<Backend> MakeCpuSse4();
// Makes the CUDA backend. Returns nullptr without a device, which is a failure of the test with
// PEPESEG_REQUIRE_CUDA=1 in the environment.
std::unique_ptr<Backend> MakeCuda();

// Base of tests on every backend, whose parameter is a BackendCase or a struct derived from it.
// Skips the backends that this machine lacks, and fails if an error is left at the end.
template <class Case>
class BackendTestOf : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    const BackendCase& backend = this->GetParam();
    backend_ = backend.make();
    if (backend_ != nullptr) return;
    if (this->HasFailure()) FAIL();  // GTEST_SKIP would not stop a failed test from running
    GTEST_SKIP() << "this machine has no " << backend.name;
  }

  void TearDown() override {
    if (backend_ == nullptr) return;
    backend_->Sync();
    EXPECT_EQ(backend_->error(), "");
  }

  std::unique_ptr<Backend> backend_;
};
using BackendTest = BackendTestOf<BackendCase>;

// Base of tests that compare the CUDA backend with the CPU's. Skipped without a device.
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
