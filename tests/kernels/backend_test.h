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

class BackendTest : public testing::TestWithParam<BackendCase> {
 protected:
  void SetUp() override {
    backend_ = GetParam().make();
    if (backend_ == nullptr) GTEST_SKIP() << "this machine has no " << GetParam().name;
  }

  std::unique_ptr<Backend> backend_;
};

inline auto AllBackends() {
  return testing::Values(BackendCase{"CpuAvx3", MakeCpuAvx3}, BackendCase{"CpuAvx2", MakeCpuAvx2},
                         BackendCase{"CpuSse4", MakeCpuSse4});
}

inline std::string BackendName(const testing::TestParamInfo<BackendCase>& info) {
  return info.param.name;
}

}  // namespace pepeseg
