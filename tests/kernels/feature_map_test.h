#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tests/kernels/backend_test.h"

namespace pepeseg {

// Base of the tests of queries on a feature map.
class FeatureMapTest : public BackendTest {
 protected:
  static constexpr int kSize = kFeatureSize;
  static constexpr int kPixels = 5003;  // not a multiple of a block or a task
  static constexpr float kMinNorm = 0.4f;

  void SetUp() override;

  // Returns random gates at some scales, [num_scales, 32], on the backend.
  Buffer<float> Gates(int num_scales);

  // The largest similarity of a pixel to the positive and to the negative queries.
  struct Best {
    float positive, negative;
  };
  // Computes them on the host from the result of Similarity. psi is [32].
  std::vector<Best> BestSimilarities(DeviceSpan<const float> psi, const Buffer<float>& queries,
                                     int num_positive);

  Buffer<Half> map_;  // [kPixels, 32]; on pixel 1 nothing was blended
};

}  // namespace pepeseg
