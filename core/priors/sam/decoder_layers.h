#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/priors/sam/encoder_network.h"
#include "kernels/backend.h"
#include "kernels/network_buffer.h"

// The weights of SAM's decoder (decoder_network.h) on a backend.
namespace pepeseg {

// A PromptLinear and a PromptNorm with their memory.
struct PromptLinearLayer {
  NetworkBuffer weight;
  Buffer<float> bias;
  PromptLinear span() const { return {weight.span(), bias.span()}; }
};
struct PromptNormLayer {
  Buffer<float> scale, shift;
  PromptNorm span() const { return {scale.span(), shift.span()}; }
};
struct PlaceAttention {  // from tokens to places
  PromptLinearLayer query, value, out;
  NetworkBuffer key;  // [in, out]
  PromptNormLayer norm;
};
struct TwoWayLayer {
  PromptLinearLayer self_query, self_key, self_value, self_out;
  PromptNormLayer self_norm;
  PlaceAttention cross;
  PromptLinearLayer mlp_in, mlp_out;
  PromptNormLayer mlp_norm;
  PromptLinearLayer key, value;  // from places to tokens, of tokens
  NetworkBuffer query, out;      // [in, out], [out, in]
  Buffer<float> query_bias, out_bias;
  PromptNormLayer places_norm;
};

// A 2 x 2 convolution with stride 2 of a mask prompt, on the host.
struct MaskDownscaling {
  std::vector<float> weight;              // [2 down, 2 across, in, out]
  std::vector<float> bias, scale, shift;  // [out]
  int num_in = 0, num_out = 0;
};

// All weights. Matrices of places are [in, out] where they are folded into tokens.
struct DecoderLayers {
  DecoderLayers(Backend& backend_in, Precision precision_in, int side_in)
      : backend(backend_in), precision(precision_in), side(side_in) {}

  Backend& backend;
  const Precision precision;
  const int side;
  Buffer<float> frequencies, label_tokens, fixed_tokens, no_mask;
  NetworkBuffer positions;  // [places, 256]
  std::array<TwoWayLayer, 2> layers = {};
  PlaceAttention last = {};
  NetworkBuffer first_upscaling, second_upscaling;
  Buffer<float> first_bias, second_bias;
  PromptNormLayer upscaling_norm = {};
  std::array<std::array<PromptLinearLayer, 3>, 1 + kPromptMasks> heads = {};  // the IoUs' first
  std::array<MaskDownscaling, 2> mask_layers = {};
  NetworkBuffer mask_weight;  // [kMaskPlanes, 256]
  Buffer<float> mask_bias;    // [256]

  // Reads all weights, or returns the first error of `weights` or of the backend.
  absl::Status Read(WeightSource weights);
};

inline constexpr int kMaskPlanes = 16;  // channels of a mask prompt before its last convolution

// Returns a mask prompt after its two convolutions with stride 2, [places, kMaskPlanes], computed
// on the host: 5 MMAC. mask: logits, [4 side, 4 side].
std::vector<float> DownscaledMask(const DecoderLayers& layers, std::span<const float> mask);

// Returns the error that the backend keeps: RESOURCE_EXHAUSTED for a lack of memory, else INTERNAL.
absl::Status ErrorOf(const Backend& backend);

}  // namespace pepeseg
