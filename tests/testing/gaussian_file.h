#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/formats/gaussian_blocks.h"
#include "core/scene/gaussians.h"

namespace pepeseg::testing {

// Returns Gaussians whose parameters are all normally distributed.
inline Gaussians RandomGaussians(int64_t count, int sh_degree) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  Gaussians gaussians = Gaussians::Zero(count, sh_degree);
  for (float& value : gaussians.planes) value = normal(random);
  return gaussians;
}

// Returns the indices of all Gaussians.
inline std::vector<uint32_t> AllOf(const Gaussians& gaussians) {
  std::vector<uint32_t> all(static_cast<size_t>(gaussians.count));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// Returns the file. Expects of each block what GaussianBlocks promises.
inline std::string FileOf(const GaussianBlocks& blocks) {
  std::string file;
  for (int64_t i = 0; i < blocks.num_blocks(); ++i) {
    const std::string block = blocks.Encode(i);
    EXPECT_LE(static_cast<int64_t>(block.size()), GaussianBlocks::kMaxBlockBytes);
    EXPECT_EQ(block, blocks.Encode(i));
    file += block;
  }
  return file;
}

}  // namespace pepeseg::testing
