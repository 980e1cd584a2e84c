#include <cuda_runtime.h>

#include <cmath>

#include "kernels/cuda/channel.cuh"
#include "kernels/cuda/cuda_backend.h"
#include "kernels/math/adam.h"
#include "kernels/math/feature.h"

// The features of Gaussians, from and to sampled pixels (kernels/ops/feature.h; METHOD.md section
// 3).
//
// FeatureRows: F(p) = sum_i w_pi fbar_i. One warp per pixel, one lane per channel, which it sums in
// the order of the row's entries: the same in every run. Blocks are four warps that share nothing.
//
// FeatureCatchUp and FeatureUpdate: lazy Adam on the
// features that a batch touches, and Adam on the gate. The formula of the replay of missed steps is
// at FeatureState.
//
// One warp per Gaussian, one lane per channel of its feature and moments; a block is eight warps
// that share nothing. In FeatureUpdate the last block has the gate, one thread per number. Sums
// over channels, and over the terms of the replay, are shuffles over the warp; the gradient of a
// feature is gathered over its column in the order of the entries. No Gaussian is listed twice, so
// there are no atomics, and results are the same in every run.

namespace pepeseg {
namespace {

constexpr int kRowsBlock = 128;

// 16 loads of features are in flight at once.
__global__ void __launch_bounds__(kRowsBlock) FeatureRowsKernel(FeatureRowsArgs args) {
  const int64_t pixel = (int64_t{blockIdx.x} * kRowsBlock + threadIdx.x) / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (pixel + 1 >= args.rows.first.size) return;
  const EntryRange row = {args.rows.first.data[pixel], args.rows.first.data[pixel + 1],
                          args.rows.gaussian.data, args.rows.weight.data};
  args.pixel_features.data[pixel * kFeatureSize + lane] =
      WeightedSum<16>(row, args.features.data, lane);
}

}  // namespace

void CudaBackend::FeatureRows(const FeatureRowsArgs& args) {
  const Turn turn(*this);
  const int64_t num_pixels = args.rows.first.size - 1;
  if (!turn || num_pixels <= 0) return;
  FeatureRowsKernel<<<NumBlocks(num_pixels * 32, kRowsBlock), kRowsBlock, 0, stream_>>>(args);
  Launched("feature rows");
}

namespace {

constexpr int kBlock = 256;
constexpr int kWarps = kBlock / 32;

// Logarithms to base 2 of the factors in the formula of FeatureState; the ratio is
// beta1 / sqrt(beta2).
struct Powers {
  float log2_ratio, log2_beta1, log2_beta2;
  float ratio_of_warp;  // ratio^32: from a lane's term to its next
};

// One channel of a Gaussian's feature and of its moments.
struct Row {
  float feature, moment1, moment2;
};
__device__ Row LoadRow(const FeatureState& state, int64_t i) {
  return {state.features.data[i], state.moment1.data[i], state.moment2.data[i]};
}
__device__ void StoreRow(const Row& row, int64_t i, const FeatureState& state) {
  state.features.data[i] = row.feature;
  state.moment1.data[i] = row.moment1;
  state.moment2.data[i] = row.moment2;
}

// The sum in the formula of FeatureState, over at most kMaxReplay steps. Lane k adds terms k + 1,
// k + 33, and so on.
__device__ float ReplaySum(const FeatureCatchUpArgs& args, const Powers& powers, int last_step) {
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int count = min(args.step - last_step, kMaxReplay);
  float sum = 0, term = exp2f(static_cast<float>(lane + 1) * powers.log2_ratio);
#pragma unroll
  for (int base = 1; base <= kMaxReplay; base += 32) {
    const int j = base + lane;
    if (j <= count) sum = MulAdd(term, args.rates.correction.data[last_step + j], sum);
    term *= powers.ratio_of_warp;
  }
  return Total(Channel(sum)).v;
}

// Rows are loaded before it is known whether they have to move, so that the loads overlap.
__global__ void __launch_bounds__(kBlock)
    CatchUpKernel(FeatureCatchUpArgs args, Powers powers, int64_t count) {
  const int64_t touched = int64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  if (touched >= count) return;
  const int64_t gaussian = args.gaussian.size == 0 ? touched : args.gaussian.data[touched];
  const int lane = static_cast<int>(threadIdx.x) % 32;
  const int last_step = args.state.last_step.data[gaussian];
  Row row = LoadRow(args.state, gaussian * kFeatureSize + lane);
  // After step 0 there are no moments yet.
  if (last_step > 0 && last_step < args.step) {
    const int behind = args.step - last_step;
    const float move = -ReplaySum(args, powers, last_step) * args.rates.learning_rate;
    const float direction = row.moment1 / (Sqrt(row.moment2) + args.rates.epsilon);
    row.feature = MulAdd(move, direction, row.feature);
    row.moment1 *= exp2f(static_cast<float>(min(behind, kMaxReplay)) * powers.log2_beta1);
    row.moment2 *= exp2f(static_cast<float>(behind) * powers.log2_beta2);
    StoreRow(row, gaussian * kFeatureSize + lane, args.state);
  }
  __syncwarp();  // all lanes have read last_step
  if (lane == 0) args.state.last_step.data[gaussian] = args.step;
}

// One step of Adam on the gate's weights and biases, by one block.
__device__ void UpdateGate(const FeatureUpdateArgs& args, const AdamRates<float>& rates) {
  for (int64_t k = threadIdx.x; k < args.gate.size; k += kBlock) {
    args.gate.data[k] += AdamStep(rates, args.rates.learning_rate, args.gate_grad.data[k],
                                  args.gate_moment1.data[k], args.gate_moment2.data[k]);
  }
}

// One step of Adam on the touched features. norm_scale is the weight of the norm term of one of
// them.
__global__ void __launch_bounds__(kBlock) UpdateKernel(FeatureUpdateArgs args, float norm_scale) {
  const AdamRates<float> rates = {args.rates.beta1, args.rates.beta2, args.rates.epsilon,
                                  args.rates.correction.data[args.step], 1};
  if (blockIdx.x + 1 == gridDim.x) return UpdateGate(args, rates);
  const int64_t touched = int64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  const int lane = static_cast<int>(threadIdx.x) % 32;
  if (touched >= args.columns.gaussian.size) return;
  const int64_t gaussian = args.columns.gaussian.data[touched];
  const int64_t i = gaussian * kFeatureSize + lane;
  Row row = LoadRow(args.state, i);
  Channel sum(WeightedSum<4>(ColumnOf(args.columns, touched), args.pixel_grad.data, lane));
  const Channel feature(row.feature);
  if (args.of_direction) {
    Channel direction(0);
    const Channel inv_length = Direction(&feature, 1, &direction);
    DirectionVjp(&direction, inv_length, 1, &sum);
  }
  const Channel pull = NormTermVjp(&feature, 1, Channel(norm_scale));
  row.feature += AdamStep(rates, args.rates.learning_rate, MulAdd(pull.v, feature.v, sum.v),
                          row.moment1, row.moment2);
  StoreRow(row, i, args.state);
  if (lane == 0) args.state.last_step.data[gaussian] = args.step;
}

Powers PowersOf(const FeatureRates& rates) {
  const double log2_beta1 = std::log2(double{rates.beta1});
  const double log2_beta2 = std::log2(double{rates.beta2});
  const double log2_ratio = log2_beta1 - log2_beta2 / 2;
  return {static_cast<float>(log2_ratio), static_cast<float>(log2_beta1),
          static_cast<float>(log2_beta2), static_cast<float>(std::exp2(32 * log2_ratio))};
}

}  // namespace

void CudaBackend::FeatureCatchUp(const FeatureCatchUpArgs& args) {
  const Turn turn(*this);
  const int64_t count =
      args.gaussian.empty() ? args.state.last_step.size : int64_t{args.gaussian.size};
  if (!turn || count == 0) return;
  CatchUpKernel<<<NumBlocks(count, kWarps), kBlock, 0, stream_>>>(args, PowersOf(args.rates),
                                                                  count);
  Launched("feature catch-up");
}

void CudaBackend::FeatureUpdate(const FeatureUpdateArgs& args) {
  const Turn turn(*this);
  if (!turn) return;
  const int64_t count = args.columns.gaussian.size;
  const float norm_scale = count == 0 ? 0 : args.norm_weight / static_cast<float>(count);
  UpdateKernel<<<NumBlocks(count, kWarps) + 1, kBlock, 0, stream_>>>(args, norm_scale);
  Launched("feature update");
}

}  // namespace pepeseg
