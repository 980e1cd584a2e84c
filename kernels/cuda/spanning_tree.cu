#include <cuda_runtime.h>

#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/tree_work.cuh"
#include "kernels/math/reach.h"

// SpanningTree (SpanningTreeArgs in kernels/ops/cluster.h): the minimum spanning tree under mutual
// reachability, by Boruvka's rounds: each component finds its least edge to another one, and the
// components that these edges connect become one. Least edges come from short lists of nearest
// neighbours where these decide them, and from a scan of all points where they do not
// (tree_distances.cu).
//
// All kernels of this file: one thread per point (or listed row, or edge). A round is
// seven launches, and the stream is the only barrier between them. Within a launch threads
// communicate by integer atomics: minima (Lower), and counters that give out places in a list. The
// exception is NameKernel, see there.
//
// The number of rounds is known beforehand and the host waits for nothing: after the last edge is
// found, the launches that remain do nothing. The order in which edges are found depends on timing,
// but the order of edges by (weight, points) is total, so the set of edges is unique, and it is
// sorted at the end: results are the same in every run.

namespace pepeseg {
namespace {

constexpr int kBlock = 256;
// Neighbours beyond those that the core distance needs: with them the lists decide most of the
// tree, without examining all pairs.
constexpr int kMoreNeighbours = 3;
constexpr int kMaxNearest = 32;
static_assert(kMaxMinSamples - 1 <= kMaxNearest);

constexpr uint32_t kNoWeight = ~uint32_t{0};
using Pair = uint64_t;  // two points, the lower index in the upper half
constexpr Pair kNoPair = ~Pair{0};

struct TreeCounts {
  int32_t num_edges, num_rows;  // edges found; points to be scanned in this round
  int32_t done;                 // all edges are found: what is still launched does nothing
};

// State of Boruvka's rounds. Weights are the bits of squared distances, which order as these do.
struct TreeWork {
  int num_points, num_nearest;
  const float* core;                // [n]
  float* nearest_squared;           // [n, num_nearest] ascending
  int32_t* nearest;                 // [n, num_nearest]
  EdgeKey* scanned;                 // [n] the least edge to another component at the last scan
  EdgeKey* own;                     // [n] the least one known now; kNoEdge: none
  uint32_t* unseen;                 // [n] lower bound on the weights of edges that are not known;
                                    // kNoWeight: `own` is the least of all
  int32_t *component, *parent;      // [n] a component is named by one of its points, its root
  uint32_t* least_weight;           // [n] least weight of the edges that leave a component
  Pair* least_pair;                 // [n] the first edge of that weight in the order of edges
  int32_t* row;                     // [n] points to be scanned
  TreeCounts* counts;               // [1]
  uint32_t *weight, *other_weight;  // [n] edges found, and space to sort them
  Pair *pair, *other_pair;          // [n]
};

__device__ uint32_t WeightOf(EdgeKey key) { return static_cast<uint32_t>(key >> 32); }
__device__ int32_t PointOf(EdgeKey key) { return static_cast<int32_t>(key); }
__device__ Pair PairOf(int32_t a, int32_t b) {
  return static_cast<Pair>(min(a, b)) << 32 | static_cast<Pair>(max(a, b));
}
__device__ int ThreadPoint() {
  return static_cast<int>(blockIdx.x) * kBlock + static_cast<int>(threadIdx.x);
}
// Sets *value to the smaller of *value and `to`, atomically.
template <class T>
__device__ void Lower(T* value, T to) {
  if constexpr (sizeof(T) == 8) {
    atomicMin(reinterpret_cast<unsigned long long*>(value), static_cast<unsigned long long>(to));
  } else {
    atomicMin(value, to);
  }
}

// Makes each point a component of its own.
__global__ void __launch_bounds__(kBlock) BeginKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point == 0) *w.counts = {0, 0, 0};
  if (point >= w.num_points) return;
  w.scanned[point] = kNoEdge;
  w.component[point] = w.parent[point] = point;
  w.least_weight[point] = kNoWeight;
  w.least_pair[point] = kNoPair;
}

// Finds each point's least edge to another component, as far as its list and its last scan show.
// The result of a scan holds while the point that it found is in another component; later it is
// still a lower bound, as components only grow.
__global__ void __launch_bounds__(kBlock) OwnEdgeKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point >= w.num_points || w.counts->done != 0) return;
  const int32_t component = w.component[point];
  const EdgeKey scanned = w.scanned[point];
  const float* squared = w.nearest_squared + int64_t{point} * w.num_nearest;
  const int32_t* nearest = w.nearest + int64_t{point} * w.num_nearest;
  EdgeKey own = kNoEdge;
  uint32_t unseen = __float_as_uint(squared[w.num_nearest - 1]);
  if (scanned != kNoEdge) unseen = max(unseen, WeightOf(scanned));
  if (scanned != kNoEdge && w.component[PointOf(scanned)] != component) {
    own = scanned;
    unseen = kNoWeight;
  } else {
    for (int i = 0; i < w.num_nearest && nearest[i] >= 0; ++i) {
      const int32_t other = nearest[i];
      if (w.component[other] == component) continue;
      const float reach = MutualReach(squared[i], w.core[point], w.core[other]);
      const EdgeKey key = static_cast<EdgeKey>(__float_as_uint(reach)) << 32 | other;
      own = min(own, key);
    }
  }
  w.own[point] = own;
  w.unseen[point] = unseen;
  if (own != kNoEdge) Lower(w.least_weight + component, WeightOf(own));
}

// Lists the points that may have an edge less than the least one known of their component, or an
// equal one that comes before it in the order of edges.
__global__ void __launch_bounds__(kBlock) ChooseRowsKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point >= w.num_points || w.counts->done != 0) return;
  const uint32_t unseen = w.unseen[point];
  if (unseen == kNoWeight || unseen > w.least_weight[w.component[point]]) return;
  w.row[atomicAdd(&w.counts->num_rows, 1)] = point;
  w.scanned[point] = kNoEdge;
}

// Takes over the edges that the scan has found.
__global__ void __launch_bounds__(kBlock) TakeScansKernel(TreeWork w) {
  const int i = ThreadPoint();
  if (i >= w.counts->num_rows) return;
  const int32_t point = w.row[i];
  const EdgeKey scanned = w.scanned[point];
  w.own[point] = scanned;
  Lower(w.least_weight + w.component[point], WeightOf(scanned));
}

// Finds the first, in the order of edges, of each component's edges of least weight.
__global__ void __launch_bounds__(kBlock) LeastPairKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point >= w.num_points || w.counts->done != 0) return;
  const EdgeKey own = w.own[point];
  const int32_t component = w.component[point];
  if (own == kNoEdge || WeightOf(own) != w.least_weight[component]) return;
  Lower(w.least_pair + component, PairOf(point, PointOf(own)));
}

// Hangs each component below the one that its least edge leads to, by its root's thread. The order
// of edges is total, so the only cycles are of two components with the same least edge; the one
// with the lower root stays a root and records the edge.
__global__ void __launch_bounds__(kBlock) JoinKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point >= w.num_points || w.counts->done != 0 || w.component[point] != point) return;
  const Pair pair = w.least_pair[point];
  const int32_t a = w.component[pair >> 32], b = w.component[static_cast<uint32_t>(pair)];
  const int32_t other = a == point ? b : a;
  const bool both = w.least_pair[other] == pair;
  if (!both || point > other) w.parent[point] = other;
  if (both && point > other) return;  // the other one keeps the edge
  const int32_t edge = atomicAdd(&w.counts->num_edges, 1);
  w.weight[edge] = w.least_weight[point];
  w.pair[edge] = pair;
}

// Renames the components by their new roots and resets the state for the next round. Threads read
// and shorten paths that others shorten at the same time, without synchronisation: whatever they
// write to parent[] is an ancestor nearer to the same root, so that all find that root.
__global__ void __launch_bounds__(kBlock) NameKernel(TreeWork w) {
  const int point = ThreadPoint();
  if (point == 0) {
    w.counts->num_rows = 0;
    if (w.counts->num_edges == w.num_points - 1) w.counts->done = 1;
  }
  if (point >= w.num_points) return;
  volatile int32_t* parent = w.parent;
  int32_t root = w.component[point];
  for (int32_t next = parent[root]; next != root; next = parent[root]) {
    const int32_t above = parent[next];
    parent[root] = above;
    root = above;
  }
  w.component[point] = root;
  w.least_weight[point] = kNoWeight;
  w.least_pair[point] = kNoPair;
}

__global__ void __launch_bounds__(kBlock)
    WriteEdgesKernel(int count, const uint32_t* weight, const Pair* pair, TreeEdge* edges) {
  const int i = ThreadPoint();
  if (i >= count) return;
  edges[i] = {__uint_as_float(weight[i]), static_cast<int32_t>(pair[i] >> 32),
              static_cast<int32_t>(pair[i])};
}

// Sorts the edges by weight, then by pair: first by pair, then, stably, by weight.
struct EdgeSort {
  cub::DoubleBuffer<uint32_t> weight;
  cub::DoubleBuffer<Pair> pair;
  int count, pair_bits;

  explicit EdgeSort(const TreeWork& w)
      : weight(w.weight, w.other_weight),
        pair(w.pair, w.other_pair),
        count(w.num_points - 1),
        pair_bits(32 + std::bit_width(static_cast<unsigned>(w.num_points))) {}

  cudaError_t ByPair(void* room, size_t& num_bytes, cudaStream_t stream) {
    return cub::DeviceRadixSort::SortPairs(room, num_bytes, pair, weight, count, 0, pair_bits,
                                           stream);
  }
  cudaError_t ByWeight(void* room, size_t& num_bytes, cudaStream_t stream) {
    return cub::DeviceRadixSort::SortPairs(room, num_bytes, weight, pair, count, 0, 32, stream);
  }
  size_t NumBytes() {
    size_t by_pair = 0, by_weight = 0;
    ByPair(nullptr, by_pair, nullptr);
    ByWeight(nullptr, by_weight, nullptr);
    return std::max(by_pair, by_weight);
  }
};

TreeWork TakeWork(const SpanningTreeArgs& args, Arena& arena) {
  TreeWork w = {};
  w.num_points = static_cast<int>(args.points.size / kFeatureSize);
  w.num_nearest = std::min(args.min_samples - 1 + kMoreNeighbours, kMaxNearest);
  w.core = args.core_squared.data;
  const int64_t n = w.num_points, in_lists = n * w.num_nearest;
  w.nearest_squared = arena.Take<float>(in_lists);
  w.nearest = arena.Take<int32_t>(in_lists);
  w.scanned = arena.Take<EdgeKey>(n);
  w.own = arena.Take<EdgeKey>(n);
  w.unseen = arena.Take<uint32_t>(n);
  w.component = arena.Take<int32_t>(n);
  w.parent = arena.Take<int32_t>(n);
  w.least_weight = arena.Take<uint32_t>(n);
  w.least_pair = arena.Take<Pair>(n);
  w.row = arena.Take<int32_t>(n);
  w.counts = arena.Take<TreeCounts>(1);
  w.weight = arena.Take<uint32_t>(n);
  w.other_weight = arena.Take<uint32_t>(n);
  w.pair = arena.Take<Pair>(n);
  w.other_pair = arena.Take<Pair>(n);
  return w;
}

// One round of Boruvka.
void LaunchRound(const TreeWork& w, const float* points, cudaStream_t stream) {
  const int blocks = NumBlocks(w.num_points, kBlock);
  OwnEdgeKernel<<<blocks, kBlock, 0, stream>>>(w);
  ChooseRowsKernel<<<blocks, kBlock, 0, stream>>>(w);
  LaunchScan({points, w.core, w.component, w.row, &w.counts->num_rows, w.num_points, w.scanned},
             stream);
  TakeScansKernel<<<blocks, kBlock, 0, stream>>>(w);
  LeastPairKernel<<<blocks, kBlock, 0, stream>>>(w);
  JoinKernel<<<blocks, kBlock, 0, stream>>>(w);
  NameKernel<<<blocks, kBlock, 0, stream>>>(w);
}

}  // namespace

// Makes the lists, then floor(log2 n) rounds, which are enough as a round at least halves the
// number of components, then sorts the edges.
void CudaBackend::SpanningTree(const SpanningTreeArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const int64_t num_points = args.points.size / kFeatureSize;
  constexpr int64_t kMaxPoints = 1 << 20;  // all pairs are examined within seconds
  if (args.min_samples < 1 || args.min_samples > kMaxMinSamples || num_points > kMaxPoints) {
    return Fail({"SpanningTree: min_samples " + std::to_string(args.min_samples) + " and " +
                 std::to_string(num_points) + " points; the limits are 1 to " +
                 std::to_string(kMaxMinSamples) + " and " + std::to_string(kMaxPoints)});
  }
  if (num_points == 0) return;
  Arena sizes;
  const TreeWork shape = TakeWork(args, sizes);
  size_t sort_bytes = num_points > 1 ? EdgeSort(shape).NumBytes() : 0;
  Arena arena(Temporary(sizes.num_bytes() + sort_bytes));
  if (!error_.empty()) return;
  const TreeWork work = TakeWork(args, arena);
  auto* const sort_room = arena.Take<std::byte>(static_cast<int64_t>(sort_bytes));

  LaunchNearest({args.points.data, work.num_points, args.min_samples, work.num_nearest,
                 work.nearest_squared, work.nearest, args.core_squared.data},
                stream_);
  Launched("nearest neighbours");
  if (num_points == 1) return;
  BeginKernel<<<NumBlocks(num_points, kBlock), kBlock, 0, stream_>>>(work);
  const int num_rounds = std::bit_width(static_cast<unsigned>(num_points)) - 1;
  for (int round = 0; round < num_rounds; ++round) {
    LaunchRound(work, args.points.data, stream_);
    Launched("tree round");
  }
  EdgeSort sort(work);
  Keep(sort.ByPair(sort_room, sort_bytes, stream_), "sorting the edges of a tree");
  Keep(sort.ByWeight(sort_room, sort_bytes, stream_), "sorting the edges of a tree");
  WriteEdgesKernel<<<NumBlocks(sort.count, kBlock), kBlock, 0, stream_>>>(
      sort.count, sort.weight.Current(), sort.pair.Current(), args.edges.data);
  Launched("tree edges");
}

}  // namespace pepeseg
