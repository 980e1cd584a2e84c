#pragma once

#include <vector>

#include "kernels/ops/network.h"

namespace pepeseg {

// The layers of kernels/ops/network.h, written down in double. Values are in the arguments'
// layouts; the spans of the arguments are not used.

struct LinearValues {
  std::vector<float> input, weights, bias, residual;  // bias and residual may be empty
};
std::vector<double> LinearReference(const LinearArgs& args, const LinearValues& values);

std::vector<double> LayerNormReference(const LayerNormArgs& args, const std::vector<float>& input,
                                       const std::vector<float>& scale,
                                       const std::vector<float>& shift);

std::vector<double> ConvolveReference(const Convolve3x3Args& args, const std::vector<float>& input,
                                      const std::vector<float>& weights,
                                      const std::vector<float>& bias);

std::vector<double> DepthwiseReference(const DepthwiseConvolveArgs& args,
                                       const std::vector<float>& input,
                                       const std::vector<float>& weights,
                                       const std::vector<float>& bias);

std::vector<double> AttentionReference(const WindowAttentionArgs& args,
                                       const std::vector<float>& qkv,
                                       const std::vector<float>& bias);

}  // namespace pepeseg
