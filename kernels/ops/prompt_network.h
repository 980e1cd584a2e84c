#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/network_buffer.h"

// Arguments of the decoder of SAM (Kirillov et al. 2023, "Segment Anything", appendix A): a two-way
// transformer between the tokens of a prompt and the places of the embedded photograph, and an
// upscaling of the places to masks.
//
// The projections of places are folded into tokens. The score of a head for place x with position p
// and token t is (Wk (x + p)) . q = (x + p) . (Wk^T q): a product of the place itself with a
// vector of the token. In the same way a weighted sum of projected places is the projection of the
// weighted sum of places. A head and a token are a row: row = head * slots + token, where slots is
// TokenSlots(num_tokens). Rows from num_tokens on in a head are padding.
//
// All values of networks (NetworkSpan) of an op have one precision. The CPU takes both and computes
// in float. CUDA takes Precision::kHalf only: it multiplies halves and adds in float.

namespace pepeseg {

inline constexpr int kPromptChannels = 256;                       // of a token, and of a place
inline constexpr int kPromptHeads = 8;                            // of every attention
inline constexpr int kSelfSize = kPromptChannels / kPromptHeads;  // channels of a head among tokens
inline constexpr int kCrossSize = 16;  // channels of a head between tokens and places
inline constexpr int kCrossChannels = kPromptHeads * kCrossSize;
inline constexpr int kMlpChannels = 2048;
inline constexpr int kMaxTokens = 16;   // of a prompt
inline constexpr int kFixedTokens = 5;  // the first tokens: one for the IoUs, one for each mask
inline constexpr int kPromptMasks = 4;  // of an answer
inline constexpr int kUpscaledChannels = 64, kMaskChannels = 32;  // after each upscaling
inline constexpr int kCellsPerPlace = 16;                         // 4 x 4, in reading order

// Rows of a head: num_tokens and padding.
constexpr int TokenSlots(int num_tokens) { return num_tokens <= 8 ? 8 : 16; }
constexpr int TokenRows(int num_tokens) { return kPromptHeads * TokenSlots(num_tokens); }
// Parts of the places whose weighted sums AttendToPlaces adds separately.
constexpr int PlaceParts(int num_places) { return num_places >= 4096 ? 4 : 1; }

// y = weight x + bias.
struct PromptLinear {
  ConstNetworkSpan weight = {};       // [out, in]
  DeviceSpan<const float> bias = {};  // [out]
};
// LayerNorm: y = scale (x - mean) / sqrt(variance + epsilon) + shift; epsilon is 1e-5 for tokens
// and places, and 1e-6 in the upscaling.
struct PromptNorm {
  DeviceSpan<const float> scale = {}, shift = {};
};

// Encodes points as tokens: sines, then cosines, of 2 pi g . p, where p are the point's coordinates
// in [-1, 1], plus the vector of the label. A point of label -1 is its label's vector alone.
struct PromptTokensArgs {
  int num_prompts = 0, num_points = 0;  // points of a prompt, 1 to kMaxTokens - kFixedTokens
  int frame = 0;                        // side of the square that coordinates refer to, pixels
  DeviceSpan<const float> points = {};  // [prompts, points, 2] x, y; the first pixel's centre is 0
  DeviceSpan<const int32_t> labels = {};  // [prompts, points] -1: padding, 0: outside, 1: inside,
                                          // 2 and 3: the corners of a box
  DeviceSpan<const float> frequencies = {};   // [2, 128] g
  DeviceSpan<const float> label_tokens = {};  // [5, 256] of labels -1 to 3
  DeviceSpan<const float> fixed_tokens = {};  // [kFixedTokens, 256]
  DeviceSpan<float> tokens = {};              // [prompts, kFixedTokens + points, 256]
};

// sum = places + offsets, of one photograph.
struct AddToPlacesArgs {
  ConstNetworkSpan places = {};          // [places, 256]
  DeviceSpan<const float> offsets = {};  // [places, 256], or [256] for all places
  NetworkSpan sum = {};                  // [places, 256]
};

// The softmax of tokens over places, before the projection of values: for each part of the places
// (PlaceParts) and each row, with w = exp(score - best), the sums of w x and of w.
template <class T>
struct PlaceSumsOf {
  DeviceSpan<T> sums = {};   // [prompts, parts, rows, 256]
  DeviceSpan<T> best = {};   // [prompts, parts, rows] largest score
  DeviceSpan<T> total = {};  // [prompts, parts, rows]
};
using PlaceSums = PlaceSumsOf<float>;

// End of an attention from tokens to places: tokens = norm(tokens + out(value(sums / total))).
struct CrossAttentionEnd {
  PlaceSumsOf<const float> sums = {};
  int num_parts = 0;
  PromptLinear value = {}, out = {};  // [128, 256], [256, 128]
  PromptNorm norm = {};
};
// tokens = norm(tokens + out(max(0, in(tokens)))).
struct TokenMlp {
  PromptLinear in = {}, out = {};  // [kMlpChannels, 256], [256, kMlpChannels]
  PromptNorm norm = {};
};
// Folds an attention from places to tokens into rows for UpdatePlaces.
struct PlacesFold {
  PromptLinear key = {}, value = {};  // [128, 256] of tokens
  ConstNetworkSpan query = {},
                   out = {};  // [256, 128]: [in, out] of the query, [out, in] of the output
  DeviceSpan<const float> query_bias = {};  // [128]
  NetworkSpan keys = {}, values = {};       // [prompts, rows, 256], written; 0 in padding
  DeviceSpan<float> bias = {};              // [prompts, rows], written; -infinity in padding
};
// Attention among the tokens: tokens = norm(tokens + out(attention)).
struct SelfAttention {
  bool is_first = false;  // no encoding is added to queries and keys, and no tokens to the result
  PromptLinear query = {}, key = {}, value = {}, out = {};  // [256, 256]
  PromptNorm norm = {};
};
// Folds the queries of an attention from tokens to places into rows for AttendToPlaces.
struct QueryFold {
  PromptLinear query = {};    // [128, 256]
  ConstNetworkSpan key = {};  // [256, 128]: [in, out]
  NetworkSpan rows = {};      // [prompts, rows, 256], written; 0 in padding
};

// The work on tokens between two steps over the places, in the order of the members. A step whose
// first weight is empty is skipped.
struct UpdateTokensArgs {
  int num_prompts = 0, num_tokens = 0;
  DeviceSpan<const float> encoding = {};  // [prompts, tokens, 256] tokens as PromptTokens made them
  DeviceSpan<float> tokens = {};          // [prompts, tokens, 256] updated
  CrossAttentionEnd cross = {};
  TokenMlp mlp = {};
  PlacesFold places = {};
  SelfAttention self = {};
  QueryFold query = {};
};

// Attention from tokens to places.
struct AttendToPlacesArgs {
  int num_prompts = 0, num_tokens = 0;
  int num_places = 0;               // a multiple of 64 times PlaceParts(num_places)
  ConstNetworkSpan places = {};     // [prompts, places, 256], or [places, 256] for all prompts
  ConstNetworkSpan positions = {};  // [places, 256]
  ConstNetworkSpan rows = {};       // [prompts, rows, 256] of QueryFold
  PlaceSums sums = {};              // written
};

// Attention from places to tokens:
//   updated = norm(x + out_bias + sum over rows of softmax((x + p) . key + bias) value),
// where the softmax is over the rows of a head.
struct UpdatePlacesArgs {
  int num_prompts = 0, num_tokens = 0;
  int num_places = 0;               // a multiple of 64
  ConstNetworkSpan places = {};     // [prompts, places, 256], or [places, 256] for all prompts
  ConstNetworkSpan positions = {};  // [places, 256]
  ConstNetworkSpan keys = {}, values = {};  // [prompts, rows, 256] of PlacesFold
  DeviceSpan<const float> bias = {};        // [prompts, rows] of PlacesFold
  DeviceSpan<const float> out_bias = {};    // [256]
  PromptNorm norm = {};
  NetworkSpan updated = {};  // [prompts, places, 256]; may be the memory of `places`
};

// A network of three layers with max(0, x) after the first two.
struct TokenHead {
  PromptLinear layer[3];  // [256, 256], [256, 256], [outputs, 256]
};
// Reads the answers from the fixed tokens.
struct TokenHeadsArgs {
  int num_prompts = 0, num_tokens = 0;
  DeviceSpan<const float> tokens = {};  // [prompts, tokens, 256]
  TokenHead iou = {};                   // of the first token; kPromptMasks outputs
  TokenHead mask[kPromptMasks];         // of the others; kMaskChannels outputs
  DeviceSpan<float> ious = {};          // [prompts, kPromptMasks] estimated IoUs
  DeviceSpan<float> products = {};      // [prompts, kPromptMasks, kMaskChannels] for UpscaleMasks
};

// Upscales places to 4 x 4 cells: two transposed convolutions of 2 x 2 with stride 2, the first
// followed by a LayerNorm, both by a GELU (with erf), and the product with the prompt's masks.
// Cells form a square of 4 side cells; cells right of `width` and below `height` are not counted,
// and their logits and quarters are unspecified.
struct UpscaleMasksArgs {
  int num_prompts = 0;
  int side = 0;                  // of the square of places: 8, 16, 32 or 64
  int width = 0, height = 0;     // cells that show the photograph
  ConstNetworkSpan places = {};  // [prompts, side, side, 256]
  ConstNetworkSpan first = {};   // [4, 64, 256]: quarter y, x; [out, in]
  ConstNetworkSpan second = {};  // [4, 32, 64]
  DeviceSpan<const float> first_bias = {}, second_bias = {};  // [64], [32]
  PromptNorm norm = {};                                       // of 64 channels
  DeviceSpan<const float> products = {};  // [prompts, kPromptMasks, kMaskChannels]
  // Written; `logits` may be empty.
  DeviceSpan<float> logits = {};     // [prompts, masks, 4 side, 4 side]
  DeviceSpan<int8_t> quarters = {};  // the same in quarters of a logit, rounded, within +-127
  DeviceSpan<uint32_t> bits =
      {};  // [prompts, masks, 4 side, side / 8] logit > 0, first cell lowest
  DeviceSpan<int32_t> areas = {};  // [prompts, masks, 3] counted cells with logits over -1, 0 and 1
};

}  // namespace pepeseg
