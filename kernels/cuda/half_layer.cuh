#pragma once

#include <cuda_fp16.h>

#include "kernels/network_buffer.h"
#include "kernels/ops/prompt_network.h"

namespace pepeseg {

// A layer of SAM's decoder as kernels take it.
struct HalfLayer {
  const __half* weight;  // [out, in]; null: the layer is left out
  const float* bias;     // [out]
};

inline const __half* Halves(const ConstNetworkSpan& span) {
  return static_cast<const __half*>(span.data);
}
inline __half* Halves(const NetworkSpan& span) { return static_cast<__half*>(span.data); }
inline HalfLayer LayerOf(const PromptLinear& linear) {
  return {Halves(linear.weight), linear.bias.data};
}

}  // namespace pepeseg
