#include "core/priors/sam/decoder_layers.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// Returns the transpose of a matrix, [rows, columns].
std::vector<float> TurnedMatrix(const std::vector<float>& values, int rows, int columns) {
  std::vector<float> turned(values.size());
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      turned[static_cast<size_t>(column) * rows + row] =
          values[static_cast<size_t>(row) * columns + column];
    }
  }
  return turned;
}

// Returns a transposed convolution's weights, [in, out, 2, 2], as [quarters, out, in].
std::vector<float> ByQuarter(const std::vector<float>& values, int num_in, int num_out) {
  std::vector<float> turned(values.size());
  for (int in = 0; in < num_in; ++in) {
    for (int out = 0; out < num_out; ++out) {
      for (int quarter = 0; quarter < 4; ++quarter) {
        turned[(static_cast<size_t>(quarter) * num_out + out) * num_in + in] =
            values[(static_cast<size_t>(in) * num_out + out) * 4 + quarter];
      }
    }
  }
  return turned;
}

// Adds the sines and cosines of a position, in [-1, 1], to a vector of 256.
void EncodePosition(const std::vector<float>& frequencies, double x, double y, float* out) {
  constexpr int kHalf = kPromptChannels / 2;
  for (int k = 0; k < kHalf; ++k) {
    const double angle = 2 * std::numbers::pi * (x * frequencies[k] + y * frequencies[kHalf + k]);
    out[k] = static_cast<float>(std::sin(angle));
    out[kHalf + k] = static_cast<float>(std::cos(angle));
  }
}

// Reads weights by the names of nodes into the memory of a backend.
class LayerReader {
 public:
  LayerReader(WeightSource weights, Backend& backend, Precision precision)
      : weights_(weights), backend_(backend), precision_(precision) {}

  absl::StatusOr<std::vector<float>> Values(const std::string& output, int index,
                                            std::vector<int64_t> shape) {
    return weights_(output, index, shape);
  }
  absl::Status Floats(const std::string& output, int index, std::vector<int64_t> shape,
                      Buffer<float>& to) {
    ASSIGN_OR_RETURN(const auto values, weights_(output, index, shape));
    to = Buffer<float>(backend_, std::span<const float>(values));
    return absl::OkStatus();
  }
  NetworkBuffer Put(const std::vector<float>& values) {
    return {backend_, precision_, std::span<const float>(values)};
  }
  // A projection: a MatMul with [in, out] and an Add.
  absl::Status Matrix(const std::string& name, int in, int out, bool transpose, NetworkBuffer& to) {
    ASSIGN_OR_RETURN(const auto values, Values(name + "/MatMul_output_0", 1, {in, out}));
    to = Put(transpose ? TurnedMatrix(values, in, out) : values);
    return absl::OkStatus();
  }
  absl::Status Bias(const std::string& name, int out, Buffer<float>& to) {
    return Floats(name + "/Add_output_0", 0, {out}, to);
  }
  absl::Status Linear(const std::string& name, int in, int out, PromptLinearLayer& to) {
    RETURN_IF_ERROR(Matrix(name, in, out, true, to.weight));
    return Bias(name, out, to.bias);
  }
  absl::Status Gemm(const std::string& name, int in, int out, PromptLinearLayer& to) {
    ASSIGN_OR_RETURN(const auto values, Values(name + "/Gemm_output_0", 1, {out, in}));
    to.weight = Put(values);
    return Floats(name + "/Gemm_output_0", 2, {out}, to.bias);
  }
  absl::Status Norm(const std::string& name, PromptNormLayer& to) {
    RETURN_IF_ERROR(Floats(name + "/LayerNormalization_output_0", 1, {kPromptChannels}, to.scale));
    return Floats(name + "/LayerNormalization_output_0", 2, {kPromptChannels}, to.shift);
  }
  // A bias that cancels in a softmax is read, so that all weights are, and left out.
  absl::Status SkipBias(const std::string& name, int out) {
    return Values(name + "/Add_output_0", 0, {out}).status();
  }

  absl::Status Cross(const std::string& name, const std::string& norm, PlaceAttention& to) {
    RETURN_IF_ERROR(Linear(name + "/q_proj", kPromptChannels, kCrossChannels, to.query));
    RETURN_IF_ERROR(Matrix(name + "/k_proj", kPromptChannels, kCrossChannels, false, to.key));
    RETURN_IF_ERROR(SkipBias(name + "/k_proj", kCrossChannels));
    RETURN_IF_ERROR(Linear(name + "/v_proj", kPromptChannels, kCrossChannels, to.value));
    RETURN_IF_ERROR(Linear(name + "/out_proj", kCrossChannels, kPromptChannels, to.out));
    return Norm(norm, to.norm);
  }

  absl::Status TwoWay(const std::string& name, TwoWayLayer& to) {
    const std::string self = name + "/self_attn", image = name + "/cross_attn_image_to_token";
    RETURN_IF_ERROR(Linear(self + "/q_proj", kPromptChannels, kPromptChannels, to.self_query));
    RETURN_IF_ERROR(Linear(self + "/k_proj", kPromptChannels, kPromptChannels, to.self_key));
    RETURN_IF_ERROR(Linear(self + "/v_proj", kPromptChannels, kPromptChannels, to.self_value));
    RETURN_IF_ERROR(Linear(self + "/out_proj", kPromptChannels, kPromptChannels, to.self_out));
    RETURN_IF_ERROR(Norm(name + "/norm1", to.self_norm));
    RETURN_IF_ERROR(Cross(name + "/cross_attn_token_to_image", name + "/norm2", to.cross));
    RETURN_IF_ERROR(Linear(name + "/mlp/lin1", kPromptChannels, kMlpChannels, to.mlp_in));
    RETURN_IF_ERROR(Linear(name + "/mlp/lin2", kMlpChannels, kPromptChannels, to.mlp_out));
    RETURN_IF_ERROR(Norm(name + "/norm3", to.mlp_norm));
    RETURN_IF_ERROR(Matrix(image + "/q_proj", kPromptChannels, kCrossChannels, false, to.query));
    RETURN_IF_ERROR(Bias(image + "/q_proj", kCrossChannels, to.query_bias));
    RETURN_IF_ERROR(Linear(image + "/k_proj", kPromptChannels, kCrossChannels, to.key));
    RETURN_IF_ERROR(Linear(image + "/v_proj", kPromptChannels, kCrossChannels, to.value));
    RETURN_IF_ERROR(Matrix(image + "/out_proj", kCrossChannels, kPromptChannels, true, to.out));
    RETURN_IF_ERROR(Bias(image + "/out_proj", kPromptChannels, to.out_bias));
    return Norm(name + "/norm4", to.places_norm);
  }

  // A convolution of the mask prompt with its LayerNorm, both on the host.
  absl::Status Downscale(const std::string& conv, const std::string& norm, int in, int out,
                         MaskDownscaling& to) {
    const std::string at = "/mask_downscaling/mask_downscaling.";
    ASSIGN_OR_RETURN(const auto weight, Values(at + conv + "/Conv_output_0", 1, {out, in, 2, 2}));
    to.weight.resize(weight.size());
    for (size_t k = 0; k < weight.size(); ++k) {
      const size_t quarter = k % 4, channel = k / 4 % in, o = k / 4 / in;
      to.weight[(quarter * in + channel) * out + o] = weight[k];
    }
    ASSIGN_OR_RETURN(to.bias, Values(at + conv + "/Conv_output_0", 2, {out}));
    ASSIGN_OR_RETURN(to.scale, Values(at + norm + "/Mul_output_0", 0, {out, 1, 1}));
    ASSIGN_OR_RETURN(to.shift, Values(at + norm + "/Add_1_output_0", 1, {out, 1, 1}));
    to.num_in = in;
    to.num_out = out;
    return absl::OkStatus();
  }

 private:
  WeightSource weights_;
  Backend& backend_;
  const Precision precision_;
};

// Normalises the channels of a place by LayerNorm and applies GELU.
void NormalizePlace(const MaskDownscaling& layer, float* place) {
  const auto count = static_cast<float>(layer.num_out);
  float mean = 0, variance = 0;
  for (int o = 0; o < layer.num_out; ++o) mean += place[o] / count;
  for (int o = 0; o < layer.num_out; ++o) {
    variance += (place[o] - mean) * (place[o] - mean) / count;
  }
  const float scale = 1 / std::sqrt(variance + 1e-6F);
  for (int o = 0; o < layer.num_out; ++o) {
    const float x = (place[o] - mean) * scale * layer.scale[o] + layer.shift[o];
    place[o] = 0.5F * x * (1 + std::erf(x / std::numbers::sqrt2_v<float>));
  }
}

// Convolves planes of a square, [side, side, in], to half the side, then LayerNorm and GELU. Sums
// all output channels of a value at once, so that the loop over them is vectorised.
std::vector<float> Downscaled(const MaskDownscaling& layer, const std::vector<float>& from,
                              int side) {
  const int half = side / 2;
  std::vector<float> to(static_cast<size_t>(half) * half * layer.num_out);
  for (int place = 0; place < half * half; ++place) {
    float* out = &to[static_cast<size_t>(place) * layer.num_out];
    std::copy(layer.bias.begin(), layer.bias.end(), out);
    const float* weight = layer.weight.data();
    for (int quarter = 0; quarter < 4; ++quarter) {
      const int y = place / half * 2 + quarter / 2, x = place % half * 2 + quarter % 2;
      const float* value = &from[(static_cast<size_t>(y) * side + x) * layer.num_in];
      for (int in = 0; in < layer.num_in; ++in, weight += layer.num_out) {
        for (int o = 0; o < layer.num_out; ++o) out[o] += weight[o] * value[in];
      }
    }
    NormalizePlace(layer, out);
  }
  return to;
}

// Frequencies, labels, fixed tokens and mask prompts.
absl::Status ReadPrompts(LayerReader& reader, DecoderLayers& layers) {
  ASSIGN_OR_RETURN(const auto waves,
                   reader.Values("/MatMul_output_0", 1, {2, kPromptChannels / 2}));
  layers.frequencies = Buffer<float>(layers.backend, std::span<const float>(waves));
  std::vector<float> places(static_cast<size_t>(layers.side) * layers.side * kPromptChannels);
  for (int i = 0; i < layers.side * layers.side; ++i) {
    const auto at = [&](int k) { return 2 * (k + 0.5) / layers.side - 1; };
    EncodePosition(waves, at(i % layers.side), at(i / layers.side),
                   &places[static_cast<size_t>(i) * kPromptChannels]);
  }
  layers.positions = reader.Put(places);
  std::vector<float> labels;
  for (int label = -1; label <= 3; ++label) {
    const std::string node = absl::StrCat("/Mul_", label + 4, "_output_0");
    ASSIGN_OR_RETURN(const auto values, reader.Values(node, 0, {1, kPromptChannels}));
    labels.insert(labels.end(), values.begin(), values.end());
  }
  layers.label_tokens = Buffer<float>(layers.backend, std::span<const float>(labels));
  RETURN_IF_ERROR(reader.Floats("/Expand_1_output_0", 0, {1, kFixedTokens, kPromptChannels},
                                layers.fixed_tokens));
  RETURN_IF_ERROR(reader.Floats("/Mul_9_output_0", 1, {1, kPromptChannels, 1, 1}, layers.no_mask));
  RETURN_IF_ERROR(reader.Downscale("0", "1", 1, 4, layers.mask_layers[0]));
  RETURN_IF_ERROR(reader.Downscale("3", "4", 4, kMaskPlanes, layers.mask_layers[1]));
  const std::string last_mask = "/mask_downscaling/mask_downscaling.6/Conv_output_0";
  ASSIGN_OR_RETURN(const auto weight,
                   reader.Values(last_mask, 1, {kPromptChannels, kMaskPlanes, 1, 1}));
  layers.mask_weight = reader.Put(TurnedMatrix(weight, kPromptChannels, kMaskPlanes));
  return reader.Floats(last_mask, 2, {kPromptChannels}, layers.mask_bias);
}

// Upscaling, hypernetworks and the head of IoUs.
absl::Status ReadOutputs(LayerReader& reader, DecoderLayers& layers) {
  const std::string at = "/output_upscaling/output_upscaling.";
  constexpr int kMiddle = kUpscaledChannels, kLast = kMaskChannels;
  const std::string first = at + "0/ConvTranspose_output_0",
                    second = at + "3/ConvTranspose_output_0";
  ASSIGN_OR_RETURN(const auto first_values,
                   reader.Values(first, 1, {kPromptChannels, kMiddle, 2, 2}));
  layers.first_upscaling = reader.Put(ByQuarter(first_values, kPromptChannels, kMiddle));
  RETURN_IF_ERROR(reader.Floats(first, 2, {kMiddle}, layers.first_bias));
  ASSIGN_OR_RETURN(const auto second_values, reader.Values(second, 1, {kMiddle, kLast, 2, 2}));
  layers.second_upscaling = reader.Put(ByQuarter(second_values, kMiddle, kLast));
  RETURN_IF_ERROR(reader.Floats(second, 2, {kLast}, layers.second_bias));
  RETURN_IF_ERROR(
      reader.Floats(at + "1/Mul_output_0", 0, {kMiddle, 1, 1}, layers.upscaling_norm.scale));
  RETURN_IF_ERROR(
      reader.Floats(at + "1/Add_1_output_0", 1, {kMiddle, 1, 1}, layers.upscaling_norm.shift));
  for (int head = 0; head <= kPromptMasks; ++head) {
    const std::string name = head == 0 ? std::string("/iou_prediction_head")
                                       : absl::StrCat("/output_hypernetworks_mlps.", head - 1);
    for (int layer = 0; layer < 3; ++layer) {
      const int out = layer < 2 ? kPromptChannels : head == 0 ? kPromptMasks : kMaskChannels;
      RETURN_IF_ERROR(reader.Gemm(absl::StrCat(name, "/layers.", layer), kPromptChannels, out,
                                  layers.heads[head][layer]));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status DecoderLayers::Read(WeightSource weights) {
  LayerReader reader(weights, backend, precision);
  RETURN_IF_ERROR(ReadPrompts(reader, *this));
  RETURN_IF_ERROR(reader.TwoWay("/transformer/layers.0", layers[0]));
  RETURN_IF_ERROR(reader.TwoWay("/transformer/layers.1", layers[1]));
  RETURN_IF_ERROR(
      reader.Cross("/transformer/final_attn_token_to_image", "/transformer/norm_final_attn", last));
  RETURN_IF_ERROR(ReadOutputs(reader, *this));
  return ErrorOf(backend);
}

std::vector<float> DownscaledMask(const DecoderLayers& layers, std::span<const float> mask) {
  const std::vector<float> logits(mask.begin(), mask.end());
  return Downscaled(layers.mask_layers[1],
                    Downscaled(layers.mask_layers[0], logits, 4 * layers.side), 2 * layers.side);
}

absl::Status ErrorOf(const Backend& backend) {
  const std::string error = backend.error();
  if (error.empty()) return absl::OkStatus();
  const bool memory = error.find("memory") != std::string::npos;
  return absl::Status(memory ? absl::StatusCode::kResourceExhausted : absl::StatusCode::kInternal,
                      absl::StrCat("SAM: ", error));
}

}  // namespace pepeseg
