#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/kernels/backend_test.h"
#include "tests/kernels/test_scene.h"
#include "tests/kernels/tree_reference.h"

// Spanning trees against Kruskal's algorithm in double, and the cases that the order of edges
// decides.

namespace pepeseg {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TreeResult SpanningTreeOf(Backend& backend, const std::vector<float>& points, int min_samples) {
  const int64_t count = static_cast<int64_t>(points.size()) / kFeatureSize;
  const Buffer<float> uploaded = Upload(backend, points);
  Buffer<float> core(backend, count);
  Buffer<TreeEdge> edges(backend, std::max<int64_t>(0, count - 1));
  backend.SpanningTree({uploaded.span(), min_samples, core.span(), edges.span()});
  return {Download(core), Download(edges)};
}

// Whether two results are equal to the last bit.
bool SameBytes(const TreeResult& a, const TreeResult& b) {
  const auto same = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return same(a.core_squared, b.core_squared) && same(a.edges, b.edges);
}

class SpanningTreeTest : public BackendTest {
 protected:
  // For points whose distances are exact in float: expects the same edges as the reference.
  void ExpectExact(const std::vector<float>& points, int min_samples) {
    const ReferenceTree want = ReferenceSpanningTree(points, min_samples);
    const TreeResult got = SpanningTreeOf(*backend_, points, min_samples);
    ASSERT_EQ(got.core_squared.size(), want.core_squared.size());
    for (size_t i = 0; i < want.core_squared.size(); ++i) {
      ASSERT_EQ(got.core_squared[i], static_cast<float>(want.core_squared[i])) << i;
    }
    ASSERT_EQ(got.edges.size(), want.edges.size());
    for (size_t i = 0; i < want.edges.size(); ++i) {
      ASSERT_EQ(got.edges[i].squared, static_cast<float>(want.edges[i].squared)) << i;
      ASSERT_EQ(got.edges[i].a, want.edges[i].a) << i;
      ASSERT_EQ(got.edges[i].b, want.edges[i].b) << i;
    }
  }

  // For other points two edges may be exchanged within rounding. All minimum spanning trees have
  // the same ascending weights, so these are compared.
  void ExpectNear(const std::vector<float>& points, int min_samples) {
    const ReferenceTree want = ReferenceSpanningTree(points, min_samples);
    const TreeResult got = SpanningTreeOf(*backend_, points, min_samples);
    constexpr double kTolerance = 3e-6;  // at most 32 roundings of 6e-8 each
    for (size_t i = 0; i < want.core_squared.size(); ++i) {
      ASSERT_NEAR(got.core_squared[i], want.core_squared[i], kTolerance * want.core_squared[i]);
    }
    ASSERT_EQ(got.edges.size(), want.edges.size());
    size_t num_same = 0;
    // Edges that join two components form a tree.
    std::vector<int> component(points.size() / kFeatureSize);
    for (size_t i = 0; i < component.size(); ++i) component[i] = static_cast<int>(i);
    for (size_t i = 0; i < want.edges.size(); ++i) {
      const TreeEdge edge = got.edges[i];
      ASSERT_NEAR(edge.squared, want.edges[i].squared, kTolerance * want.edges[i].squared) << i;
      const int from = component[edge.a], to = component[edge.b];
      ASSERT_NE(from, to) << "the edge closes a cycle";
      std::replace(component.begin(), component.end(), from, to);
      num_same += edge.a == want.edges[i].a && edge.b == want.edges[i].b ? 1 : 0;
    }
    EXPECT_GE(static_cast<double>(num_same), 0.99 * static_cast<double>(want.edges.size()));
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, SpanningTreeTest, AllBackends(), BackendName);

TEST_P(SpanningTreeTest, MatchesReferenceForRandomPoints) {
  for (const int count : {33, 257, 500}) {
    for (const int min_samples : {1, 2, 5, 20, kMaxMinSamples}) {
      SCOPED_TRACE(testing::Message() << count << " points, min_samples " << min_samples);
      ExpectNear(RandomValues(int64_t{count} * kFeatureSize, count), min_samples);
    }
  }
}

TEST_P(SpanningTreeTest, MatchesReferenceForClusteredPoints) {
  for (const float spread : {0.01f, 0.2f, 0.6f}) {
    SCOPED_TRACE(spread);
    ExpectNear(ClusteredPoints(450, 6, spread, 1), 5);
    ExpectNear(ClusteredPoints(450, 40, spread, 2), 3);
  }
}

TEST_P(SpanningTreeTest, MatchesEveryEdgeForExactDistances) {
  for (const int min_samples : {1, 2, 3, 5, 12, kMaxMinSamples}) {
    SCOPED_TRACE(min_samples);
    ExpectExact(LatticePoints(300, kFeatureSize, 40, 1), min_samples);
    ExpectExact(LatticePoints(401, 2, 100, 2), min_samples);
  }
}

// Most edges have others of equal length, so the order of their points decides.
TEST_P(SpanningTreeTest, TakesTheFirstOfEqualEdges) {
  for (uint64_t seed = 0; seed < 8; ++seed) {
    for (const int min_samples : {1, 2, 5, 30}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << " min_samples " << min_samples);
      ExpectExact(LatticePoints(150, 1 + static_cast<int>(seed), 3, seed), min_samples);
      ExpectExact(LatticePoints(70, 2, 6, seed), min_samples);
    }
  }
}

TEST_P(SpanningTreeTest, IsAStarForEqualPoints) {
  const std::vector<float> points(100 * kFeatureSize, 0.25f);
  ExpectExact(points, 5);
  const TreeResult tree = SpanningTreeOf(*backend_, points, 5);
  for (int i = 0; i < 99; ++i) {
    EXPECT_EQ(tree.edges[i].squared, 0);
    EXPECT_EQ(tree.edges[i].a, 0);
    EXPECT_EQ(tree.edges[i].b, i + 1);
  }
}

TEST_P(SpanningTreeTest, FollowsPointsOnALine) {
  std::vector<float> equal_gaps(301 * kFeatureSize), growing_gaps(301 * kFeatureSize);
  for (int i = 0; i < 301; ++i) {
    equal_gaps[i * kFeatureSize + 7] = static_cast<float>(i);
    // The distances of close neighbours are exact: the differences of squares are odd numbers.
    growing_gaps[i * kFeatureSize + 31] = static_cast<float>(i * i) / 8;
  }
  for (const int min_samples : {1, 2, 3, 5}) {
    SCOPED_TRACE(min_samples);
    ExpectExact(equal_gaps, min_samples);
    ExpectNear(growing_gaps, min_samples);
  }
}

TEST_P(SpanningTreeTest, MatchesReferenceForFewPoints) {
  for (int count = 0; count <= 20; ++count) {
    for (const int min_samples : {1, 2, 5, 20}) {
      SCOPED_TRACE(testing::Message() << count << " points, min_samples " << min_samples);
      ExpectExact(LatticePoints(count, 3, 5, count), min_samples);
    }
  }
}

TEST_P(SpanningTreeTest, IsInfiniteWithMoreSamplesThanPoints) {
  const TreeResult tree = SpanningTreeOf(*backend_, LatticePoints(4, 3, 9, 1), 5);
  for (const float core : tree.core_squared) EXPECT_EQ(core, kInfinity);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(tree.edges[i].squared, kInfinity);
    EXPECT_EQ(tree.edges[i].a, 0);
    EXPECT_EQ(tree.edges[i].b, i + 1);
  }
}

TEST_P(SpanningTreeTest, TreatsPointsThatAreNotFiniteAsInfinitelyFar) {
  for (const int min_samples : {1, 2, 5}) {
    SCOPED_TRACE(min_samples);
    std::vector<float> points = LatticePoints(120, 4, 6, 5);
    points[3 * kFeatureSize + 1] = kNan;
    points[60 * kFeatureSize] = -kInfinity;
    points[61 * kFeatureSize + 31] = kInfinity;
    std::fill_n(points.begin() + 119 * kFeatureSize, kFeatureSize, kNan);
    ExpectExact(points, min_samples);
    std::fill_n(points.begin(), kFeatureSize, kNan);
    ExpectExact(points, min_samples);
  }
}

TEST_P(SpanningTreeTest, TreatsDistancesBeyondFloatAsInfinite) {
  std::vector<float> points = LatticePoints(20, 4, 6, 5);
  points[7 * kFeatureSize] = 3e38f;
  const TreeResult tree = SpanningTreeOf(*backend_, points, 3);
  EXPECT_EQ(tree.core_squared[7], kInfinity);
  // The other 19 points are joined by finite edges, point 7 by an infinite one.
  EXPECT_LT(tree.edges[17].squared, 100);
  EXPECT_EQ(tree.edges[18].squared, kInfinity);
  EXPECT_EQ(tree.edges[18].a, 0);
  EXPECT_EQ(tree.edges[18].b, 7);
}

TEST_P(SpanningTreeTest, IsTheSameInASecondCall) {
  const std::vector<float> points = ClusteredPoints(2000, 20, 0.25f, 4);
  const TreeResult first = SpanningTreeOf(*backend_, points, 5);
  EXPECT_TRUE(SameBytes(first, SpanningTreeOf(*backend_, points, 5)));
}

TEST(SpanningTree, GivesTheSameBytesForAnyNumberOfThreads) {
  for (const int min_samples : {1, 5}) {
    const std::vector<float> points = ClusteredPoints(5000, 15, 0.25f, 3);
    const auto one = MakeCpuBackend(1);
    const TreeResult want = SpanningTreeOf(*one, points, min_samples);
    for (const int num_threads : {2, 3}) {
      const auto several = MakeCpuBackend(num_threads);
      EXPECT_TRUE(SameBytes(SpanningTreeOf(*several, points, min_samples), want)) << num_threads;
    }
  }
}

class CudaSpanningTreeTest : public CudaAndCpuTest {};

TEST_F(CudaSpanningTreeTest, MatchesTheCpu) {
  for (const int min_samples : {1, 5, 32}) {
    for (const int count : {1000, 4096, 16384}) {
      SCOPED_TRACE(testing::Message() << count << " points, min_samples " << min_samples);
      for (const auto& points :
           {ClusteredPoints(count, 30, 0.25f, 6), LatticePoints(count, 4, 9, 7),
            RandomValues(int64_t{count} * kFeatureSize, 8)}) {
        const TreeResult want = SpanningTreeOf(*cpu_, points, min_samples);
        // Equal to the last bit if the CPU has fused multiply-adds, as the device has.
        EXPECT_TRUE(SameBytes(SpanningTreeOf(*cuda_, points, min_samples), want));
      }
    }
  }
}

}  // namespace
}  // namespace pepeseg
