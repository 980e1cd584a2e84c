#include "kernels/ops/match.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <vector>

#include "kernels/backend.h"
#include "kernels/buffer.h"
#include "tests/kernels/backend_test.h"

// Matches of descriptors against a plain loop that decides as COLMAP 3.8 does, by angles. All
// backends and instruction sets must find the same matches.

namespace pepeseg {
namespace {

constexpr float kRatio = 0.8f, kAngle = 0.7f;
using Bytes = std::vector<uint8_t>;
using Matches = std::vector<DescriptorMatch>;

class MatchTest : public BackendTest {};
INSTANTIATE_TEST_SUITE_P(Backends, MatchTest,
                         ::testing::Values(BackendCase{"CpuVnni", MakeCpuVnni},
                                           BackendCase{"CpuAvx3", MakeCpuAvx3},
                                           BackendCase{"CpuAvx2", MakeCpuAvx2},
                                           BackendCase{"CpuSse4", MakeCpuSse4},
                                           BackendCase{"Cuda", MakeCuda}),
                         BackendName);

// RootSIFT of random histograms, of length 512 about. `seed` names the features: a block shares the
// first `num_shared` with other blocks, with a little noise of its own, in another order.
Bytes RandomBlock(int count, int num_shared, uint64_t seed) {
  std::mt19937_64 own(seed), shared(7);
  Bytes block(static_cast<size_t>(count) * kDescriptorBytes);
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), own);
  for (int i = 0; i < count; ++i) {
    double histogram[kDescriptorBytes], sum = 0;
    std::mt19937_64& source = i < num_shared ? shared : own;
    for (double& bin : histogram) {
      bin = std::pow(static_cast<double>(source() % 1000) / 1000, 4);
      if (i < num_shared) bin += static_cast<double>(own() % 1000) * 4e-5;
      sum += bin;
    }
    uint8_t* to = block.data() + static_cast<size_t>(order[i]) * kDescriptorBytes;
    for (int k = 0; k < kDescriptorBytes; ++k) {
      to[k] =
          static_cast<uint8_t>(std::min(255.0, std::round(512 * std::sqrt(histogram[k] / sum))));
    }
  }
  return block;
}

// The best match of each descriptor of `from`, or -1, in the words of COLMAP 3.8.
std::vector<int> OneWay(const Bytes& from, const Bytes& to, float ratio) {
  const int num_from = static_cast<int>(from.size()) / kDescriptorBytes;
  const int num_to = static_cast<int>(to.size()) / kDescriptorBytes;
  std::vector<int> matches(num_from, -1);
  for (int i = 0; i < num_from; ++i) {
    int best = 0, second = 0, index = -1;
    for (int j = 0; j < num_to; ++j) {
      int dot = 0;
      for (int k = 0; k < kDescriptorBytes; ++k) {
        dot += from[i * kDescriptorBytes + k] * to[j * kDescriptorBytes + k];
      }
      if (dot > best) {
        second = best;
        best = dot;
        index = j;
      } else if (dot > second) {
        second = dot;
      }
    }
    const auto angle = [](int dot) {
      return std::acos(std::min(static_cast<float>(dot) * (1.0f / (512.0f * 512.0f)), 1.0f));
    };
    if (index < 0 || angle(best) > kAngle || angle(best) >= ratio * angle(second)) continue;
    matches[i] = index;
  }
  return matches;
}

Matches PlainMatches(const Bytes& first, const Bytes& second, float ratio, bool mutual) {
  const std::vector<int> there = OneWay(first, second, ratio), back = OneWay(second, first, ratio);
  Matches matches;
  for (size_t i = 0; i < there.size(); ++i) {
    if (there[i] < 0 || (mutual && back[there[i]] != static_cast<int>(i))) continue;
    matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(there[i])});
  }
  return matches;
}

struct Options {
  float ratio = kRatio;
  bool mutual = true;
};

// Matches pairs of blocks in one call.
std::vector<Matches> Match(Backend& backend, const std::vector<Bytes>& blocks,
                           const std::vector<BlockPair>& pairs, Options options = {}) {
  Bytes all;
  std::vector<int64_t> block_first = {0};
  for (const Bytes& block : blocks) {
    all.insert(all.end(), block.begin(), block.end());
    block_first.push_back(static_cast<int64_t>(all.size()) / kDescriptorBytes);
  }
  const std::vector<int32_t> limits = SecondDotLimits(options.ratio, kAngle);
  const Buffer<uint8_t> descriptors(backend, std::span<const uint8_t>(all));
  const Buffer<int32_t> second_limits(backend, std::span<const int32_t>(limits));
  std::vector<int64_t> pair_first;
  Matches matches;
  backend.MatchDescriptors({.descriptors = descriptors.span(),
                            .block_first = block_first,
                            .pairs = pairs,
                            .second_limits = second_limits.span(),
                            .mutual = options.mutual,
                            .pair_first = &pair_first,
                            .matches = &matches});
  std::vector<Matches> of_pair;
  EXPECT_EQ(pair_first.size(), pairs.size() + 1);
  for (size_t i = 0; i + 1 < pair_first.size(); ++i) {
    of_pair.emplace_back(matches.begin() + pair_first[i], matches.begin() + pair_first[i + 1]);
  }
  return of_pair;
}

TEST_P(MatchTest, EqualsAPlainLoopForEveryTail) {
  std::vector<Bytes> blocks;
  const std::vector<int> counts = {0, 1, 2, 15, 16, 17, 31, 33, 63, 64, 65, 129, 300};
  for (const int count : counts) blocks.push_back(RandomBlock(count, count / 2, count + 100));
  std::vector<BlockPair> pairs;
  for (int i = 0; i < static_cast<int>(counts.size()); ++i) {
    for (int j = 0; j < static_cast<int>(counts.size()); ++j) pairs.push_back({i, j});
  }
  const std::vector<Matches> got = Match(*backend_, blocks, pairs);
  ASSERT_EQ(got.size(), pairs.size());
  size_t num_matches = 0;
  for (size_t p = 0; p < pairs.size(); ++p) {
    EXPECT_EQ(got[p], PlainMatches(blocks[pairs[p].first], blocks[pairs[p].second], kRatio, true))
        << counts[pairs[p].first] << " features against " << counts[pairs[p].second];
    num_matches += got[p].size();
  }
  EXPECT_GT(num_matches, 1000u);
}

TEST_P(MatchTest, EqualsAPlainLoopOfThousandsOfFeatures) {
  const std::vector<Bytes> blocks = {RandomBlock(3001, 900, 1), RandomBlock(1203, 900, 2)};
  const std::vector<Matches> got = Match(*backend_, blocks, {{0, 1}, {1, 0}});
  ASSERT_EQ(got.size(), 2u);
  const Matches want = PlainMatches(blocks[0], blocks[1], kRatio, true);
  EXPECT_GT(want.size(), 800u);
  EXPECT_EQ(got[0], want);
  // The test is symmetric, so the other direction finds the same pairs.
  Matches turned;
  for (const DescriptorMatch& match : got[1]) turned.push_back({match.second, match.first});
  std::sort(turned.begin(), turned.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  EXPECT_EQ(turned, want);
}

TEST_P(MatchTest, FindsMatchesOfOneDirection) {
  const std::vector<Bytes> blocks = {RandomBlock(256, 100, 1), RandomBlock(700, 300, 2)};
  const Options options{.ratio = 0.9f, .mutual = false};
  const std::vector<Matches> got = Match(*backend_, blocks, {{0, 1}}, options);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0], PlainMatches(blocks[0], blocks[1], 0.9f, false));
}

TEST_P(MatchTest, RefusesEquallyNearNeighbors) {
  const Bytes one = RandomBlock(1, 0, 3);
  Bytes twice = one;
  twice.insert(twice.end(), one.begin(), one.end());
  const std::vector<Matches> got = Match(*backend_, {one, twice}, {{0, 1}, {1, 0}, {0, 0}});
  ASSERT_EQ(got.size(), 3u);
  EXPECT_TRUE(got[0].empty());
  EXPECT_TRUE(got[1].empty());
  EXPECT_EQ(got[2], Matches({{0, 0}}));
}

// Not descriptors of photographs, but a damaged file may hold them.
TEST_P(MatchTest, ComputesTheLargestAndTheSmallestProducts) {
  Bytes extreme(3 * kDescriptorBytes, 0);
  std::fill(extreme.begin(), extreme.begin() + kDescriptorBytes, uint8_t{255});
  std::fill(extreme.begin() + kDescriptorBytes, extreme.begin() + kDescriptorBytes + 64,
            uint8_t{64});
  const std::vector<Matches> got = Match(*backend_, {extreme}, {{0, 0}});
  ASSERT_EQ(got.size(), 1u);
  EXPECT_EQ(got[0], PlainMatches(extreme, extreme, kRatio, true));
}

TEST_P(MatchTest, MatchesNoPairs) {
  EXPECT_TRUE(Match(*backend_, {RandomBlock(5, 5, 1)}, {}).empty());
}

TEST(SecondDotLimits, DecideAsTheAnglesDo) {
  const std::vector<int32_t> limits = SecondDotLimits(kRatio, kAngle);
  const auto angle = [](int dot) {
    return std::acos(static_cast<float>(dot) * (1.0f / (512.0f * 512.0f)));
  };
  for (int best = 0; best <= kFullDot; best += 37) {
    const int limit = limits[best];
    if (best == 0 || angle(best) > kAngle) {
      EXPECT_EQ(limit, -1) << best;
      continue;
    }
    if (limit >= 0) {
      EXPECT_LT(angle(best), kRatio * angle(limit)) << best;
    }
    EXPECT_LT(limit, best);
    EXPECT_GE(angle(best), kRatio * angle(limit + 1)) << best;
  }
}

}  // namespace
}  // namespace pepeseg
