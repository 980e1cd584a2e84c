#include <algorithm>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/feature.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int64_t kChunk = 64;  // pixels of a task, and the granularity of the gate's sums

struct NearCentroid {
  int index = -1;
  float cosine = 0;
};

// Returns the centroid with the largest cosine above min_cosine; index -1 if there is none. Of
// equal ones the first.
NearCentroid FindNear(const CentroidLossArgs& args, const float* unit) {
  NearCentroid best = {-1, args.min_cosine};
  for (int64_t k = 0; k < args.centroids.size / kFeatureSize; ++k) {
    const float* centroid = args.centroids.data + k * kFeatureSize;
    float cosine = 0;
    for (int c = 0; c < kFeatureSize; ++c) cosine = MulAdd(unit[c], centroid[c], cosine);
    if (cosine > best.cosine) best = {static_cast<int>(k), cosine};
  }
  return best;
}

}  // namespace

// Two parallel passes over the pixels, with the mean's count summed serially in between. Gradients
// of the gate are summed for each chunk, then over the chunks in their order.
void CpuBackend::CentroidLoss(const CentroidLossArgs& args) {
  if (failed()) return;
  const int64_t num_pixels = args.pixel_features.size / kFeatureSize;
  float psi[kFeatureSize];
  GateAt({args.gate.data, args.gate.size}, kFeatureSize, args.scale, psi);
  std::vector<NearCentroid> near(num_pixels);
  const int64_t num_chunks = (num_pixels + kChunk - 1) / kChunk;
  const auto for_each_pixel = [&](const auto& body) {
    pool_.ParallelFor(num_chunks, [&](int64_t chunk, int) {
      const int64_t end = std::min(num_pixels, (chunk + 1) * kChunk);
      for (int64_t p = chunk * kChunk; p < end; ++p) body(p, chunk);
    });
  };
  for_each_pixel([&](int64_t p, int64_t) {
    float unit[kFeatureSize];
    GatedUnit(psi, args.pixel_features.data + p * kFeatureSize, kFeatureSize, unit);
    near[p] = FindNear(args, unit);
  });
  // Serial, in the order of the pixels.
  args.sums[kCentroidLoss] = args.sums[kNumNearCentroids] = 0;
  for (const NearCentroid& of_pixel : near) {
    if (of_pixel.index < 0) continue;
    args.sums[kCentroidLoss] += 1 - double{of_pixel.cosine};
    ++args.sums[kNumNearCentroids];
  }
  if (args.sums[kNumNearCentroids] == 0) return;
  // d(1 - C) / d unit = -centroid, over the number of pixels near one.
  const auto pull = static_cast<float>(-double{args.weight} / args.sums[kNumNearCentroids]);
  std::vector<float> psi_grads(num_chunks * kFeatureSize);
  for_each_pixel([&](int64_t p, int64_t chunk) {
    if (near[p].index < 0) return;
    float unit_grad[kFeatureSize];
    const float* centroid = args.centroids.data + int64_t{near[p].index} * kFeatureSize;
    for (int k = 0; k < kFeatureSize; ++k) unit_grad[k] = pull * centroid[k];
    GatedUnitVjp(psi, args.pixel_features.data + p * kFeatureSize, kFeatureSize, unit_grad,
                 args.pixel_grad.data + p * kFeatureSize, psi_grads.data() + chunk * kFeatureSize);
  });
  float psi_grad[kFeatureSize] = {};
  for (size_t i = 0; i < psi_grads.size(); ++i) psi_grad[i % kFeatureSize] += psi_grads[i];
  GateAtVjp({args.gate.data, args.gate.size}, kFeatureSize, args.scale, psi_grad,
            args.gate_grad.data);
}

}  // namespace pepeseg
