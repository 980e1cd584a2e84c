// Measures HDBSCAN on unit vectors of 30 clusters and noise: the tree on the device (by kernel on
// CUDA) and the clusters on the host. Usage:
//   pepeseg_cluster_bench [--device cpu|cuda] [--points n]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/cluster/hdbscan.h"
#include "kernels/backend.h"
#include "tests/bench/bench_backend.h"
#include "tests/bench/bench_clock.h"

namespace pepeseg {
namespace {

constexpr int kNumClusters = 30;
constexpr int kRepeats = 7;
constexpr HdbscanOptions kOptions;

// Every tenth point has a direction of its own.
std::vector<float> UnitVectors(int count) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal;
  std::vector<float> centres(static_cast<size_t>(kNumClusters) * kFeatureSize);
  for (float& value : centres) value = normal(random);
  std::vector<float> points(static_cast<size_t>(count) * kFeatureSize);
  for (int point = 0; point < count; ++point) {
    const float* centre = centres.data() + random() % kNumClusters * kFeatureSize;
    float* at = points.data() + static_cast<size_t>(point) * kFeatureSize;
    float squares = 0;
    for (int k = 0; k < kFeatureSize; ++k) {
      at[k] = point % 10 == 0 ? normal(random) : centre[k] + 0.25f * normal(random);
      squares += at[k] * at[k];
    }
    for (int k = 0; k < kFeatureSize; ++k) at[k] /= std::sqrt(squares);
  }
  return points;
}

struct Times {
  double tree_ms, host_ms;
  Clusters clusters;
};

// Measures medians over repeats. The points are on the device already; copying the edges to the
// host counts.
Times Measure(Backend& backend, int count) {
  const std::vector<float> points = UnitVectors(count);
  const Buffer<float> uploaded(backend, std::span<const float>(points));
  Buffer<float> core(backend, count);
  Buffer<TreeEdge> edges(backend, count - 1);
  std::vector<TreeEdge> host_edges(count - 1);
  std::vector<double> tree_ms, host_ms;
  Clusters clusters;
  for (int repeat = 0; repeat <= kRepeats; ++repeat) {
    backend.Sync();
    const double start = NowMs();
    backend.SpanningTree({uploaded.span(), kOptions.min_samples, core.span(), edges.span()});
    edges.Download(std::span<TreeEdge>(host_edges));
    const double tree = NowMs();
    clusters = ClustersOf(host_edges, kOptions.min_cluster_size);
    if (repeat == 0) continue;  // warm-up: allocates memory, loads code
    tree_ms.push_back(tree - start);
    host_ms.push_back(NowMs() - tree);
  }
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + kRepeats / 2, values.end());
    return values[kRepeats / 2];
  };
  return {median(tree_ms), median(host_ms), std::move(clusters)};
}

void PrintKernels(int count) {
  std::vector<KernelTime> times;
  const std::unique_ptr<Backend> backend = MakeBenchBackend("cuda", 0, &times);
  if (backend == nullptr) return;
  Measure(*backend, count);
  backend->Sync();
  std::printf("\n| kernel, %d points | us | calls |\n|---|---|---|\n", count);
  for (const KernelTime& time : times) {
    std::printf("| %s | %.1f | %.0f |\n", time.name.c_str(), 1e3 * time.ms / (kRepeats + 1),
                static_cast<double>(time.calls) / (kRepeats + 1));
  }
}

int Main(std::span<char*> argv) {
  bool cuda = false;
  std::vector<int> counts = {1024, 4096, 16384};
  for (size_t i = 1; i + 1 < argv.size(); i += 2) {
    const std::string flag = argv[i], value = argv[i + 1];
    if (flag == "--device") cuda = value == "cuda";
    if (flag == "--points") counts = {std::max(2, std::atoi(value.c_str()))};
  }
  const std::unique_ptr<Backend> backend = MakeBenchBackend(cuda ? "cuda" : "cpu", 0, nullptr);
  if (backend == nullptr) return 1;
  std::printf("%s, min_samples %d, min_cluster_size %d\n\n", backend->name().c_str(),
              kOptions.min_samples, kOptions.min_cluster_size);
  std::printf("| points | core distances and tree, ms | host, ms | clusters | noise |\n");
  std::printf("|---|---|---|---|---|\n");
  for (const int count : counts) {
    const Times times = Measure(*backend, count);
    const auto& labels = times.clusters.labels;
    std::printf("| %d | %.2f | %.2f | %d | %d |\n", count, times.tree_ms, times.host_ms,
                times.clusters.count,
                static_cast<int>(std::count(labels.begin(), labels.end(), kNoise)));
  }
  if (cuda) PrintKernels(counts.back());
  if (!backend->error().empty()) std::printf("ERROR %s\n", backend->error().c_str());
  return backend->error().empty() ? 0 : 1;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  return pepeseg::Main(std::span<char*>(argv, static_cast<size_t>(argc)));
}
