#include "core/priors/sam/encoder_layers.h"

#include <cstdint>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "kernels/half.h"

namespace pepeseg {
namespace {

using Weights = std::vector<float>;

// Returns [columns, rows] of [rows, columns].
Weights Transposed(const Weights& values, int64_t rows, int64_t columns) {
  Weights out(values.size());
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t c = 0; c < columns; ++c) out[c * rows + r] = values[r * columns + c];
  }
  return out;
}

// A convolution's output is named after its module, and so are its weights, inputs 1 and 2.
std::string ConvolutionOf(const std::string& module) {
  return absl::StrCat(module, "/c/Conv_output_0");
}

class LayerLoader {
 public:
  LayerLoader(WeightSource weights, Backend& backend, Precision precision)
      : weights_(weights), backend_(backend), precision_(precision) {}

  // 1x1 convolution with bias.
  absl::StatusOr<LinearLayer> Pointwise(const std::string& module, int in, int out) {
    const std::string name = ConvolutionOf(module);
    ASSIGN_OR_RETURN(const Weights values, Read(name, 1, {out, in, 1, 1}));
    ASSIGN_OR_RETURN(const Weights bias, Read(name, 2, {out}));
    return Linear(in, out, Transposed(values, out, in), bias);
  }

  // 3x3 convolution. `padded`: channels of its input, of which those from `in` on are zeros.
  absl::StatusOr<LinearLayer> Dense(const std::string& name, int in, int padded, int out,
                                    bool has_bias) {
    ASSIGN_OR_RETURN(const Weights values, Read(name, 1, {out, in, 3, 3}));
    Weights bias;
    if (has_bias) {
      ASSIGN_OR_RETURN(bias, Read(name, 2, {out}));
    }
    Weights ordered(size_t{9} * padded * out);
    for (int to = 0; to < out; ++to) {
      for (int from = 0; from < in; ++from) {
        for (int tap = 0; tap < 9; ++tap) {
          ordered[(tap * padded + from) * out + to] = values[(to * in + from) * 9 + tap];
        }
      }
    }
    return Linear(padded, out, ordered, bias);
  }

  absl::StatusOr<DepthwiseLayer> Depthwise(const std::string& module, int channels, int stride) {
    const std::string name = ConvolutionOf(module);
    ASSIGN_OR_RETURN(const Weights values, Read(name, 1, {channels, 1, 3, 3}));
    ASSIGN_OR_RETURN(const Weights bias, Read(name, 2, {channels}));
    return DepthwiseLayer{channels, stride, Floats(Transposed(values, channels, 9)), Floats(bias)};
  }

  absl::StatusOr<BottleneckLayers> Bottleneck(const std::string& module, int in, int middle,
                                              int out, int stride) {
    BottleneckLayers layers;
    ASSIGN_OR_RETURN(layers.expand, Pointwise(module + "/conv1", in, middle));
    ASSIGN_OR_RETURN(layers.depthwise, Depthwise(module + "/conv2", middle, stride));
    ASSIGN_OR_RETURN(layers.project, Pointwise(module + "/conv3", middle, out));
    return layers;
  }

  absl::StatusOr<AttentionLayers> Attention(const std::string& module, int channels, int heads,
                                            int side) {
    const std::string attention = module + "/attn", mlp = module + "/mlp";
    const int inner = heads * kHeadSize;
    AttentionLayers layers;
    ASSIGN_OR_RETURN(layers.qkv,
                     Matrix(attention + "/qkv", channels, 3 * inner, attention + "/norm"));
    ASSIGN_OR_RETURN(layers.project, Matrix(attention + "/proj", inner, channels, ""));
    const int tokens = side * side;
    ASSIGN_OR_RETURN(const Weights bias,
                     Read(attention + "/Add_output_0", 1, {heads, tokens, tokens}));
    layers.bias_stride = (tokens + 7) / 8 * 8;
    Weights padded(int64_t{heads} * tokens * layers.bias_stride);
    for (size_t k = 0; k < bias.size(); ++k) {
      padded[k / tokens * layers.bias_stride + k % tokens] = bias[k];
    }
    layers.bias = NetworkBuffer(backend_, precision_, padded);
    ASSIGN_OR_RETURN(layers.depthwise, Depthwise(module + "/local_conv", channels, 1));
    ASSIGN_OR_RETURN(layers.widen, Matrix(mlp + "/fc1", channels, 4 * channels, mlp + "/norm"));
    ASSIGN_OR_RETURN(layers.narrow, Matrix(mlp + "/fc2", 4 * channels, channels, ""));
    return layers;
  }

  // The neck's first convolution, which has no bias.
  absl::StatusOr<LinearLayer> Neck(int in, int out) {
    ASSIGN_OR_RETURN(const Weights values, Read("/neck/neck.0/Conv_output_0", 1, {out, in, 1, 1}));
    return Linear(in, out, Transposed(values, out, in), {});
  }

  // A LayerNorm over channels whose product with the scale is `product` and whose end is `sum`.
  absl::StatusOr<LayerNormLayer> NeckNorm(const std::string& product, const std::string& sum,
                                          int channels) {
    ASSIGN_OR_RETURN(const Weights scale, Read(product, 0, {channels, 1, 1}));
    ASSIGN_OR_RETURN(const Weights shift, Read(sum, 1, {channels, 1, 1}));
    return LayerNormLayer{Floats(scale), Floats(shift)};
  }

 private:
  absl::StatusOr<Weights> Read(const std::string& output, int index,
                               std::initializer_list<int64_t> shape) {
    return weights_(output, index, std::span(shape.begin(), shape.size()));
  }
  Buffer<float> Floats(const Weights& values) { return {backend_, std::span<const float>(values)}; }
  LinearLayer Linear(int in, int out, const Weights& values, const Weights& bias) {
    LinearLayer layer = {in, out, false, NetworkBuffer(backend_, precision_, values), {}, {}};
    if (!bias.empty()) layer.bias = Floats(bias);
    return layer;
  }

  // A matrix product and its bias, after the LayerNorm `norm` unless that is empty. The norm's
  // scale goes into the weights and its shift, through the weights, into the bias.
  absl::StatusOr<LinearLayer> Matrix(const std::string& module, int in, int out,
                                     const std::string& norm) {
    ASSIGN_OR_RETURN(Weights values, Read(module + "/MatMul_output_0", 1, {in, out}));
    ASSIGN_OR_RETURN(Weights bias, Read(module + "/Add_output_0", 0, {out}));
    if (norm.empty()) return Linear(in, out, values, bias);
    ASSIGN_OR_RETURN(const Weights scale, Read(norm + "/Mul_output_0", 1, {in}));
    ASSIGN_OR_RETURN(const Weights shift, Read(norm + "/Add_1_output_0", 1, {in}));
    std::vector<double> sums(out), shifted(bias.begin(), bias.end());
    for (size_t k = 0; k < values.size(); ++k) {
      const size_t from = k / out, to = k % out;
      shifted[to] += static_cast<double>(shift[from]) * static_cast<double>(values[k]);
      values[k] *= scale[from];
      // The sums are those of the weights as stored, so that a row's mean cancels exactly.
      if (precision_ == Precision::kHalf) values[k] = FloatFromHalf(HalfFromFloat(values[k]));
      sums[to] += static_cast<double>(values[k]);
    }
    LinearLayer layer = Linear(in, out, values, {shifted.begin(), shifted.end()});
    layer.normalize = true;
    layer.column_sums = Floats({sums.begin(), sums.end()});
    return layer;
  }

  WeightSource weights_;
  Backend& backend_;
  Precision precision_;
};

absl::Status LoadStages(const EncoderShape& shape, LayerLoader& loader, EncoderLayers& layers) {
  for (int block = 0; block < shape.blocks[0]; ++block) {
    ASSIGN_OR_RETURN(auto loaded,
                     loader.Bottleneck(absl::StrCat("/layers.0/blocks.", block), shape.channels[0],
                                       4 * shape.channels[0], shape.channels[0], 1));
    layers.convolutions.push_back(std::move(loaded));
  }
  for (int stage = 0; stage < 3; ++stage) {
    const int to = shape.channels[stage + 1];
    // The last two stages have the same places.
    ASSIGN_OR_RETURN(layers.downsampling[stage],
                     loader.Bottleneck(absl::StrCat("/layers.", stage, "/downsample"),
                                       shape.channels[stage], to, to, stage == 2 ? 1 : 2));
    for (int block = 0; block < shape.blocks[stage + 1]; ++block) {
      ASSIGN_OR_RETURN(auto loaded,
                       loader.Attention(absl::StrCat("/layers.", stage + 1, "/blocks.", block), to,
                                        shape.heads[stage + 1], shape.window[stage + 1]));
      layers.attention[stage].push_back(std::move(loaded));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<EncoderLayers> LoadEncoderLayers(const EncoderShape& shape, WeightSource weights,
                                                Backend& backend, Precision precision) {
  LayerLoader loader(weights, backend, precision);
  EncoderLayers layers;
  const int half = shape.channels[0] / 2;
  ASSIGN_OR_RETURN(layers.first, loader.Dense(ConvolutionOf("/patch_embed/seq/seq.0"), 3,
                                              kFrameChannels, half, true));
  ASSIGN_OR_RETURN(layers.second, loader.Dense(ConvolutionOf("/patch_embed/seq/seq.2"), half, half,
                                               shape.channels[0], true));
  RETURN_IF_ERROR(LoadStages(shape, loader, layers));
  const int out = shape.embedding;
  ASSIGN_OR_RETURN(layers.neck, loader.Neck(shape.channels[3], out));
  ASSIGN_OR_RETURN(layers.neck_norm, loader.NeckNorm("/neck/neck.1/Mul_output_0",
                                                     "/neck/neck.1/Add_1_output_0", out));
  ASSIGN_OR_RETURN(layers.neck_convolution,
                   loader.Dense("/neck/neck.2/Conv_output_0", out, out, out, false));
  ASSIGN_OR_RETURN(layers.last_norm, loader.NeckNorm("/neck/neck.3/Mul_output_0", "output", out));
  const std::string error = backend.error();
  if (!error.empty()) return absl::ResourceExhaustedError(absl::StrCat("SAM's encoder: ", error));
  return layers;
}

}  // namespace pepeseg
