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
  std::string name;
  std::function<std::unique_ptr<Backend>()> make;
};

class BackendTest : public testing::TestWithParam<BackendCase> {
 protected:
  std::unique_ptr<Backend> backend_ = GetParam().make();
};

inline auto AllBackends() {
  return testing::Values(BackendCase{"Cpu", [] { return MakeCpuBackend(2); }});
}

inline std::string BackendName(const testing::TestParamInfo<BackendCase>& info) {
  return info.param.name;
}

}  // namespace pepeseg
