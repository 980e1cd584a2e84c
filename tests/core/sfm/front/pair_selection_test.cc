#include "core/sfm/front/pair_selection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pepeseg {
namespace {

using Pairs = std::vector<PhotographPair>;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(Pairs, AreAllPairsOnce) {
  EXPECT_EQ(AllPairs(4), (Pairs{{0, 1}, {0, 2}, {1, 2}, {0, 3}, {1, 3}, {2, 3}}));
  EXPECT_THAT(AllPairs(1), IsEmpty());
  EXPECT_THAT(AllPairs(0), IsEmpty());
}

TEST(Pairs, OfNeighborsReachToPowersOfTwo) {
  std::vector<size_t> distances;
  for (const PhotographPair& pair : NeighborPairs(40, 3, true)) {
    if (pair.first == 0) distances.push_back(pair.second);
  }
  EXPECT_THAT(distances, ElementsAre(1, 2, 3, 4, 8, 16, 32));
  EXPECT_EQ(NeighborPairs(4, 10, true), AllPairs(4));
  EXPECT_EQ(NeighborPairs(4, 1, false), (Pairs{{0, 1}, {1, 2}, {2, 3}}));
}

TEST(Groups, AreJoinedByVerifiedPairs) {
  const PhotographGroups groups = GroupsOf(6, {{0, 3}, {3, 5}, {1, 2}});
  EXPECT_EQ(groups.num_groups, 3u);
  EXPECT_THAT(groups.group, ElementsAre(0, 1, 1, 0, 2, 0));
  EXPECT_EQ(groups.bridges, (Pairs{{1, 2}, {0, 3}, {3, 5}}));
}

TEST(Groups, HaveABridgeWhereTwoLoopsMeet) {
  const PhotographGroups groups =
      GroupsOf(6, {{0, 1}, {1, 2}, {0, 2}, {2, 3}, {3, 4}, {4, 5}, {3, 5}});
  EXPECT_EQ(groups.num_groups, 1u);
  EXPECT_EQ(groups.bridges, (Pairs{{2, 3}}));
}

// The number of groups by joining names.
size_t PlainNumGroups(size_t n, const Pairs& pairs) {
  std::vector<size_t> name(n);
  for (size_t i = 0; i < n; ++i) name[i] = i;
  for (const PhotographPair& pair : pairs) {
    const size_t from = name[pair.first], to = name[pair.second];
    std::replace(name.begin(), name.end(), from, to);
  }
  std::sort(name.begin(), name.end());
  return std::unique(name.begin(), name.end()) - name.begin();
}

TEST(Groups, AreThoseOfAPlainSearchInRandomGraphs) {
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    const size_t n = 1 + random() % 9;
    Pairs pairs;
    for (const PhotographPair& pair : AllPairs(n)) {
      if (random() % 3 == 0) pairs.push_back(pair);
    }
    const PhotographGroups groups = GroupsOf(n, pairs);
    ASSERT_EQ(groups.num_groups, PlainNumGroups(n, pairs));
    Pairs bridges;
    for (size_t i = 0; i < pairs.size(); ++i) {
      Pairs others = pairs;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      if (PlainNumGroups(n, others) > groups.num_groups) bridges.push_back(pairs[i]);
    }
    ASSERT_EQ(groups.bridges, bridges);
  }
}

// Scores that fall with the distance in a ring.
PairScores RingScores(size_t n) {
  PairScores scores(n);
  for (const PhotographPair& pair : AllPairs(n)) {
    const size_t distance = pair.second - pair.first;
    const size_t around = std::min(distance, n - distance);
    if (around < 5) scores.Add(pair.first, pair.second, static_cast<int64_t>(100 - around));
  }
  return scores;
}

TEST(PairSelection, TakesTheBestOfEachPhotograph) {
  PairSelection selection(RingScores(20));
  const Pairs first = selection.Next(2);
  EXPECT_EQ(first.size(), 20u);
  for (const PhotographPair& pair : first) {
    EXPECT_TRUE(pair.second - pair.first == 1 || pair.second - pair.first == 19);
  }
  EXPECT_TRUE(std::binary_search(first.begin(), first.end(), PhotographPair{0, 19},
                                 [](const PhotographPair& a, const PhotographPair& b) {
                                   return std::pair(a.second, a.first) <
                                          std::pair(b.second, b.first);
                                 }));
}

TEST(PairSelection, HandsOutEachPairOnce) {
  PairSelection selection(RingScores(20));
  selection.Skip({{0, 1}});
  Pairs all;
  for (int round = 0; round < 10; ++round) {
    const Pairs next = selection.Next(2);
    all.insert(all.end(), next.begin(), next.end());
  }
  // Four neighbours on either side have scores, of which one pair was skipped.
  EXPECT_EQ(all.size(), 79u);
  std::sort(all.begin(), all.end());
  EXPECT_EQ(std::unique(all.begin(), all.end()), all.end());
}

TEST(PairSelection, ContinuesOutsideTheLargestGroupAndAtBridges) {
  PairSelection selection(RingScores(12));
  selection.Next(2);
  // Photographs 0 to 8 are a loop with 9 at a bridge; 10 and 11 are alone.
  Pairs verified;
  for (size_t i = 0; i < 8; ++i) verified.push_back({i, i + 1});
  verified.push_back({0, 8});
  verified.push_back({8, 9});
  const Pairs next = selection.NextAtCuts(GroupsOf(12, verified), 1);
  for (const PhotographPair& pair : next) {
    const auto at_cut = [](size_t i) { return i >= 8; };
    EXPECT_TRUE(at_cut(pair.first) || at_cut(pair.second)) << pair.first << " " << pair.second;
  }
  EXPECT_GE(next.size(), 2u);
  EXPECT_LE(next.size(), 4u);
}

TEST(PairSelection, EndsWhereThereIsNoCutOrNothingIsLeft) {
  PairSelection selection(RingScores(6));
  EXPECT_THAT(
      selection.NextAtCuts(GroupsOf(6, {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {0, 5}}), 3),
      IsEmpty());
  EXPECT_EQ(selection.Next(100).size(), 15u);
  EXPECT_THAT(selection.NextAtCuts(GroupsOf(6, {}), 3), IsEmpty());
}

}  // namespace
}  // namespace pepeseg
