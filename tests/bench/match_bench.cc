// Measures MatchDescriptors on descriptors of random histograms, all pairs in one call. Usage:
//   pepeseg_match_bench [--device cpu|cuda] [--threads n] [--photographs n] [--features n]

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "kernels/backend.h"
#include "kernels/buffer.h"
#include "kernels/ops/match.h"
#include "tests/bench/bench_backend.h"

namespace pepeseg {
namespace {

struct Flags {
  std::string device = "cpu";
  int num_threads = 1, num_photographs = 12, num_features = 3000;
};

// RootSIFT of random histograms.
std::vector<uint8_t> Descriptors(int64_t count) {
  std::mt19937 random(1);
  std::vector<uint8_t> descriptors;
  descriptors.reserve(count * kDescriptorBytes);
  for (int64_t i = 0; i < count; ++i) {
    double histogram[kDescriptorBytes], sum = 0;
    for (double& bin : histogram) sum += bin = std::pow(static_cast<double>(random() % 1000), 3);
    for (const double bin : histogram) {
      descriptors.push_back(static_cast<uint8_t>(std::min(255.0, 512 * std::sqrt(bin / sum))));
    }
  }
  return descriptors;
}

int Main(const Flags& flags) {
  std::vector<KernelTime> times;
  const auto backend = MakeBenchBackend(flags.device, flags.num_threads, &times);
  if (backend == nullptr) return 1;
  const int64_t n = flags.num_features;
  const Buffer<uint8_t> descriptors(
      *backend, std::span<const uint8_t>(Descriptors(n * flags.num_photographs)));
  const Buffer<int32_t> limits(*backend, std::span<const int32_t>(SecondDotLimits(0.8f, 0.7f)));
  std::vector<int64_t> block_first = {0};
  std::vector<BlockPair> pairs;
  for (int second = 0; second < flags.num_photographs; ++second) {
    block_first.push_back((second + 1) * n);
    for (int first = 0; first < second; ++first) pairs.push_back({first, second});
  }
  std::vector<int64_t> pair_first;
  std::vector<DescriptorMatch> matches;
  for (int repeat = 0; repeat < 3; ++repeat) {
    times.clear();
    const double wall = Now(), core = CoreNow();
    backend->MatchDescriptors({.descriptors = descriptors.span(),
                               .block_first = block_first,
                               .pairs = pairs,
                               .second_limits = limits.span(),
                               .pair_first = &pair_first,
                               .matches = &matches});
    backend->Sync();
    const double scale = 1000 / static_cast<double>(pairs.size());
    std::printf("%s: %d features, %zu pairs: %.3f ms wall, %.3f core ms per pair",
                backend->name().c_str(), flags.num_features, pairs.size(), (Now() - wall) * scale,
                (CoreNow() - core) * scale);
    for (const KernelTime& time : times) {
      std::printf("; %s %.4f ms per pair", time.name.c_str(), time.ms * scale / 1000);
    }
    std::printf("\n");
  }
  if (backend->error().empty()) return 0;
  std::fprintf(stderr, "%s\n", backend->error().c_str());
  return 1;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  pepeseg::Flags flags;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string flag = argv[i];
    if (flag == "--device") flags.device = argv[i + 1];
    if (flag == "--threads") flags.num_threads = std::atoi(argv[i + 1]);
    if (flag == "--photographs") flags.num_photographs = std::atoi(argv[i + 1]);
    if (flag == "--features") flags.num_features = std::atoi(argv[i + 1]);
  }
  return pepeseg::Main(flags);
}
