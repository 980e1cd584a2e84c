#pragma once

#include <array>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/encoder_network.h"
#include "kernels/backend.h"
#include "kernels/network_buffer.h"

namespace pepeseg {

// Layers of a TinyViT encoder with their weights on a backend, in the layouts of
// kernels/ops/network.h.

// A Linear or, with 9 `in` rows of weights, a Convolve3x3.
struct LinearLayer {
  int in = 0, out = 0;
  bool normalize = false;  // a LayerNorm comes first; its scale and shift are in the weights
  NetworkBuffer weights;
  Buffer<float> bias, column_sums;  // column_sums only where `normalize`
};

struct DepthwiseLayer {
  int channels = 0, stride = 1;
  Buffer<float> weights, bias;
};

struct LayerNormLayer {
  Buffer<float> scale, shift;
};

// 1x1 convolution, depthwise 3x3, 1x1: an MBConv, or the downsampling between stages.
struct BottleneckLayers {
  LinearLayer expand;
  DepthwiseLayer depthwise;
  LinearLayer project;
};

// A block of attention within windows.
struct AttentionLayers {
  LinearLayer qkv, project;
  NetworkBuffer bias;  // [heads, tokens, bias_stride]
  int bias_stride = 0;
  DepthwiseLayer depthwise;
  LinearLayer widen, narrow;  // the two layers of the MLP
};

struct EncoderLayers {
  LinearLayer first, second;                              // convolutions of the patch embedding
  std::vector<BottleneckLayers> convolutions;             // stage 0
  std::array<BottleneckLayers, 3> downsampling;           // from stage k to k + 1
  std::array<std::vector<AttentionLayers>, 3> attention;  // stages 1 to 3
  LinearLayer neck, neck_convolution;
  LayerNormLayer neck_norm, last_norm;
};

// Reads the weights under the names of encoder.onnx. Returns the errors of `weights`, and
// RESOURCE_EXHAUSTED when the backend is out of memory.
absl::StatusOr<EncoderLayers> LoadEncoderLayers(const EncoderShape& shape, WeightSource weights,
                                                Backend& backend, Precision precision);

}  // namespace pepeseg
