#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tests/kernels/backend_test.h"

namespace pepeseg {

// Of the ops that ask questions of a feature map.
class FeatureMapTest : public BackendTest {
 protected:
  static constexpr int kSize = kFeatureSize;
  static constexpr int kPixels = 5003;  // no multiple of a block or a task
  static constexpr float kMinNorm = 0.4f;

  void SetUp() override;

  // Gates at some scales: [num_scales, 32], on the backend.
  Buffer<float> Gates(int num_scales);

  // What Similarity says, put together on the host: the best to the queries of either kind.
  struct Best {
    float positive, negative;
  };
  // psi: [32].
  std::vector<Best> BestSimilarities(DeviceSpan<const float> psi, const Buffer<float>& queries,
                                     int num_positive);

  Buffer<Half> map_;  // [kPixels, 32]; on pixel 1 nothing was blended
};

}  // namespace pepeseg
