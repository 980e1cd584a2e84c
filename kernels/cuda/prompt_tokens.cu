#include <cuda_fp16.h>
#include <cuda_runtime.h>

#include <cstdint>

#include "kernels/cuda/cuda_backend.h"
#include "kernels/cuda/half_layer.cuh"
#include "kernels/cuda/half_tiles.cuh"
#include "kernels/ops/prompt_network.h"

// PromptTokens and TokenHeads (kernels/ops/prompt_network.h); UpdateTokens is in update_tokens.cu.
//
// HeadsKernel: one block per prompt (y) and head (x): the IoUs or a mask. A warp computes an
// output, a lane eight factors; activations stay floats.

namespace pepeseg {
namespace {

constexpr int kBlock = 256, kWarps = kBlock / 32;
constexpr int kSize = kPromptChannels;

__global__ void __launch_bounds__(kPromptChannels / 2) TokensKernel(PromptTokensArgs p) {
  constexpr int kHalf = kSize / 2;
  const auto k = static_cast<int>(threadIdx.x);
  const int num_tokens = kFixedTokens + p.num_points;
  float* token = p.tokens.data + int64_t{blockIdx.x} * num_tokens * kSize;
  for (int i = k; i < kFixedTokens * kSize; i += kHalf) token[i] = p.fixed_tokens.data[i];
  token += kFixedTokens * kSize;
  for (int i = 0; i < p.num_points; ++i, token += kSize) {
    const int64_t point = int64_t{blockIdx.x} * p.num_points + i;
    const int label = p.labels.data[point];
    float sine = 0, cosine = 0;
    if (label >= 0) {
      const float x = 2 * ((p.points.data[2 * point] + 0.5f) / p.frame) - 1;
      const float y = 2 * ((p.points.data[2 * point + 1] + 0.5f) / p.frame) - 1;
      sincospif(2 * (x * p.frequencies.data[k] + y * p.frequencies.data[kHalf + k]), &sine,
                &cosine);
    }
    token[k] = p.label_tokens.data[(label + 1) * kSize + k] + sine;
    token[kHalf + k] = p.label_tokens.data[(label + 1) * kSize + kHalf + k] + cosine;
  }
}

struct HeadParams {
  int num_tokens;
  const float* tokens;
  HalfLayer layer[1 + kPromptMasks][3];  // the IoUs' head first
  float *ious, *products;
};

// Computes outputs of a layer from x, [256] in shared memory, with max(0, y) if asked for.
__device__ void HeadLayer(const HalfLayer& linear, const float* x, int num_out, bool positive,
                          float* out) {
  const int warp = static_cast<int>(threadIdx.x) / 32, lane = static_cast<int>(threadIdx.x) % 32;
  float own[8];
  for (int k = 0; k < 8; ++k) own[k] = x[8 * lane + k];
#pragma unroll 4
  for (int row = warp; row < num_out; row += kWarps) {
    const uint4 word =
        __ldg(reinterpret_cast<const uint4*>(linear.weight + row * kSize + 8 * lane));
    const float2 a = UnpackHalves(word.x), b = UnpackHalves(word.y);
    const float2 c = UnpackHalves(word.z), d = UnpackHalves(word.w);
    float sum = ((own[0] * a.x + own[1] * a.y) + (own[2] * b.x + own[3] * b.y)) +
                ((own[4] * c.x + own[5] * c.y) + (own[6] * d.x + own[7] * d.y));
    for (int offset = 16; offset > 0; offset /= 2) sum += __shfl_xor_sync(~0u, sum, offset);
    sum += linear.bias[row];
    if (lane == 0) out[row] = positive ? fmaxf(sum, 0) : sum;
  }
  __syncthreads();
}

__global__ void __launch_bounds__(kBlock) HeadsKernel(HeadParams p) {
  __shared__ float x[2][kSize];
  const auto head = static_cast<int>(blockIdx.x);
  const int64_t prompt = blockIdx.y;
  x[0][threadIdx.x] = p.tokens[(prompt * p.num_tokens + head) * kSize + threadIdx.x];
  __syncthreads();
  HeadLayer(p.layer[head][0], x[0], kSize, true, x[1]);
  HeadLayer(p.layer[head][1], x[1], kSize, true, x[0]);
  if (head == 0) {
    HeadLayer(p.layer[0][2], x[0], kPromptMasks, false, p.ious + prompt * kPromptMasks);
  } else {
    HeadLayer(p.layer[head][2], x[0], kMaskChannels, false,
              p.products + (prompt * kPromptMasks + head - 1) * kMaskChannels);
  }
}

}  // namespace

void CudaBackend::PromptTokens(const PromptTokensArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  TokensKernel<<<args.num_prompts, kSize / 2, 0, stream_>>>(args);
  Launched("prompt tokens");
}

void CudaBackend::TokenHeads(const TokenHeadsArgs& args) {
  const Turn turn(*this);
  if (!turn || args.num_prompts == 0) return;
  HeadParams p = {};
  p.num_tokens = args.num_tokens;
  p.tokens = args.tokens.data;
  for (int layer = 0; layer < 3; ++layer) {
    p.layer[0][layer] = LayerOf(args.iou.layer[layer]);
    for (int mask = 0; mask < kPromptMasks; ++mask) {
      p.layer[1 + mask][layer] = LayerOf(args.mask[mask].layer[layer]);
    }
  }
  p.ious = args.ious.data;
  p.products = args.products.data;
  HeadsKernel<<<dim3(1 + kPromptMasks, args.num_prompts), kBlock, 0, stream_>>>(p);
  Launched("token heads");
}

}  // namespace pepeseg
