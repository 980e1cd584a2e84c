#include "core/priors/sam/decoder_network.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/decoder_layers.h"
#include "core/priors/sam/onnx_weights.h"

namespace pepeseg {

// Memory of a run over DecodedAtOnce() prompts at most; grows only.
struct DecoderNetwork::Scratch {
  Buffer<float> points;
  Buffer<int32_t> labels;
  Buffer<float> encoding, tokens, products;
  NetworkBuffer planes;        // [places, kMaskPlanes] of a mask prompt
  NetworkBuffer start;         // [places, 256]: the embedding and that of the mask, or of none
  NetworkBuffer places;        // [prompts, places, 256]
  NetworkBuffer rows;          // [prompts, rows, 256] for AttendToPlaces
  NetworkBuffer keys, values;  // the same for UpdatePlaces
  Buffer<float> bias;          // [prompts, rows]
  Buffer<float> sums, best, total;

  PlaceSums Sums() { return {sums.span(), best.span(), total.span()}; }
};

DecoderNetwork::DecoderNetwork(std::unique_ptr<DecoderLayers> layers)
    : layers_(std::move(layers)), scratch_(std::make_unique<Scratch>()) {}
DecoderNetwork::~DecoderNetwork() = default;

int DecoderNetwork::side() const { return layers_->side; }
Precision DecoderNetwork::precision() const { return layers_->precision; }

absl::StatusOr<std::unique_ptr<DecoderNetwork>> DecoderNetwork::Make(int side, WeightSource weights,
                                                                     Backend& backend,
                                                                     Precision precision) {
  auto layers = std::make_unique<DecoderLayers>(backend, precision, side);
  RETURN_IF_ERROR(layers->Read(weights));
  return std::unique_ptr<DecoderNetwork>(new DecoderNetwork(std::move(layers)));
}

absl::StatusOr<std::unique_ptr<DecoderNetwork>> DecoderNetwork::Load(
    const std::filesystem::path& onnx, Backend& backend, Precision precision) {
  constexpr int kSide = 64;
  const auto unexpected = [](const absl::Status& status) {
    return absl::IsInvalidArgument(status) ? absl::FailedPreconditionError(status.message())
                                           : status;
  };
  absl::StatusOr<OnnxWeights> weights = OnnxWeights::Read(onnx);
  if (!weights.ok()) return unexpected(weights.status());
  auto network = Make(
      kSide,
      [&](absl::string_view output, int index, std::span<const int64_t> shape) {
        return weights->Input(output, index, shape);
      },
      backend, precision);
  if (!network.ok()) return unexpected(network.status());
  // The positions of places, which Make computes, and what chooses one mask, which is not used.
  const auto places = weights->Input("/pe_layer/MatMul_output_0", 0, {kSide, kSide, 2});
  if (!places.ok()) return unexpected(places.status());
  const auto choice = weights->Input("/Mul_12_output_0", 1, {1, kPromptMasks});
  if (!choice.ok()) return unexpected(choice.status());
  RETURN_IF_ERROR(unexpected(weights->CheckAllRead()));
  return network;
}

absl::Status DecoderNetwork::Decode(ConstNetworkSpan embedding,
                                    std::span<const DecoderPoint> points, int num_points,
                                    const DecoderGrid& grid, bool with_logits,
                                    DecodedMasks& masks) {
  Backend& backend = layers_->backend;
  if (scratch_->start.size() == 0) {
    scratch_->start = NetworkBuffer(backend, layers_->precision, embedding.size);
  }
  RETURN_IF_ERROR(ErrorOf(backend));
  backend.AddToPlaces({embedding, layers_->no_mask.span(), scratch_->start.span()});
  return Run(points, num_points, grid, with_logits, masks);
}

// The last convolution of the mask is a product, and the photograph's embedding its residual.
absl::Status DecoderNetwork::DecodeWithMask(ConstNetworkSpan embedding,
                                            std::span<const DecoderPoint> points,
                                            std::span<const float> mask, const DecoderGrid& grid,
                                            DecodedMasks& masks) {
  const DecoderLayers& l = *layers_;
  if (std::cmp_not_equal(mask.size(), extent() * extent())) {
    return absl::InvalidArgumentError(
        absl::StrCat("SAM: a mask prompt has ", mask.size(), " logits, not ", extent() * extent()));
  }
  Scratch& s = *scratch_;
  const std::vector<float> planes = DownscaledMask(l, mask);
  if (s.planes.size() == 0) {
    s.planes = NetworkBuffer(l.backend, l.precision, static_cast<int64_t>(planes.size()));
  }
  if (s.start.size() == 0) s.start = NetworkBuffer(l.backend, l.precision, embedding.size);
  RETURN_IF_ERROR(ErrorOf(l.backend));
  s.planes.Upload(planes);
  l.backend.Linear({.rows = int64_t{side()} * side(),
                    .in = kMaskPlanes,
                    .out = kPromptChannels,
                    .input = s.planes.span(),
                    .weights = l.mask_weight.span(),
                    .bias = l.mask_bias.span(),
                    .residual = embedding,
                    .output = s.start.span()});
  return Run(points, static_cast<int>(points.size()), grid, /*with_logits=*/true, masks);
}

namespace {

// The steps on tokens; each leaves out what its UpdateTokens does not need.
CrossAttentionEnd EndOf(const PlaceAttention& cross, const PlaceSums& sums, int num_parts) {
  return {{sums.sums, sums.best, sums.total},
          num_parts,
          cross.value.span(),
          cross.out.span(),
          cross.norm.span()};
}
SelfAttention SelfOf(const TwoWayLayer& layer, bool is_first) {
  return {is_first,
          layer.self_query.span(),
          layer.self_key.span(),
          layer.self_value.span(),
          layer.self_out.span(),
          layer.self_norm.span()};
}
TokenMlp MlpOf(const TwoWayLayer& layer) {
  return {layer.mlp_in.span(), layer.mlp_out.span(), layer.mlp_norm.span()};
}
QueryFold QueryOf(const PlaceAttention& cross, NetworkSpan rows) {
  return {cross.query.span(), cross.key.span(), rows};
}

}  // namespace

// Answers prompts [first, first + num_prompts) of those in the scratch. The tokens of a layer wait
// for the places of the layer before, and the places for the tokens of their layer.
void DecoderNetwork::RunChunk(int first, int num_prompts, int num_points, const DecoderGrid& grid,
                              DecodedMasks& masks) {
  const DecoderLayers& l = *layers_;
  Backend& backend = l.backend;
  Scratch& s = *scratch_;
  const int num_tokens = kFixedTokens + num_points, num_places = side() * side();
  const int num_parts = PlaceParts(num_places);
  const int64_t token_size = int64_t{num_prompts} * num_tokens * kPromptChannels;
  const DeviceSpan<float> encoding = s.encoding.span().Subspan(0, token_size);
  const DeviceSpan<float> tokens = s.tokens.span().Subspan(0, token_size);
  const NetworkSpan start = s.start.span();
  const NetworkSpan places = s.places.span().Subspan(0, num_prompts * start.size);
  backend.PromptTokens(
      {num_prompts, num_points, frame(),
       s.points.span().Subspan(int64_t{2} * first * num_points,
                               int64_t{2} * num_prompts * num_points),
       s.labels.span().Subspan(int64_t{first} * num_points, int64_t{num_prompts} * num_points),
       l.frequencies.span(), l.label_tokens.span(), l.fixed_tokens.span(), encoding});
  backend.Copy(tokens.data, encoding.data, static_cast<size_t>(token_size) * sizeof(float));

  UpdateTokensArgs update = {
      .num_prompts = num_prompts, .num_tokens = num_tokens, .encoding = encoding, .tokens = tokens};
  update.self = SelfOf(l.layers[0], /*is_first=*/true);
  update.query = QueryOf(l.layers[0].cross, s.rows.span());
  backend.UpdateTokens(update);
  for (int layer = 0; layer < 3; ++layer) {
    const NetworkSpan from = layer == 0 ? start : places;
    backend.AttendToPlaces(
        {num_prompts, num_tokens, num_places, from, l.positions.span(), s.rows.span(), s.Sums()});
    const bool is_last = layer == 2;
    update.cross = EndOf(is_last ? l.last : l.layers[layer].cross, s.Sums(), num_parts);
    update.self = {};
    update.query = {};
    update.mlp = {};
    update.places = {};
    if (!is_last) {
      const TwoWayLayer& own = l.layers[layer];
      update.mlp = MlpOf(own);
      update.places = {own.key.span(),        own.value.span(), own.query.span(), own.out.span(),
                       own.query_bias.span(), s.keys.span(),    s.values.span(),  s.bias.span()};
      if (layer == 0) update.self = SelfOf(l.layers[1], /*is_first=*/false);
      update.query = QueryOf(layer == 0 ? l.layers[1].cross : l.last, s.rows.span());
    }
    backend.UpdateTokens(update);
    if (is_last) break;
    backend.UpdatePlaces({num_prompts, num_tokens, num_places, from, l.positions.span(),
                          s.keys.span(), s.values.span(), s.bias.span(),
                          l.layers[layer].out_bias.span(), l.layers[layer].places_norm.span(),
                          places});
  }

  TokenHeadsArgs heads;
  heads.num_prompts = num_prompts;
  heads.num_tokens = num_tokens;
  heads.tokens = tokens;
  for (int layer = 0; layer < 3; ++layer) {
    heads.iou.layer[layer] = l.heads[0][layer].span();
    for (int mask = 0; mask < kPromptMasks; ++mask) {
      heads.mask[mask].layer[layer] = l.heads[1 + mask][layer].span();
    }
  }
  const int64_t first_mask = int64_t{first} * kPromptMasks;
  const int64_t num_masks = int64_t{num_prompts} * kPromptMasks;
  const int64_t cells = int64_t{extent()} * extent();
  heads.ious = masks.ious.span().Subspan(first_mask, num_masks);
  heads.products = s.products.span();
  backend.TokenHeads(heads);
  UpscaleMasksArgs upscale = {.num_prompts = num_prompts,
                              .side = side(),
                              .width = grid.width,
                              .height = grid.height,
                              .places = places,
                              .first = l.first_upscaling.span(),
                              .second = l.second_upscaling.span(),
                              .first_bias = l.first_bias.span(),
                              .second_bias = l.second_bias.span(),
                              .norm = l.upscaling_norm.span(),
                              .products = s.products.span()};
  if (!masks.logits.empty()) {
    upscale.logits = masks.logits.span().Subspan(first_mask * cells, num_masks * cells);
  }
  upscale.quarters = masks.quarters.span().Subspan(first_mask * cells, num_masks * cells);
  upscale.bits = masks.bits.span().Subspan(first_mask * cells / 32, num_masks * cells / 32);
  upscale.areas = masks.areas.span().Subspan(first_mask * 3, num_masks * 3);
  backend.UpscaleMasks(upscale);
}

absl::Status DecoderNetwork::Run(std::span<const DecoderPoint> points, int num_points,
                                 const DecoderGrid& grid, bool with_logits, DecodedMasks& masks) {
  Backend& backend = layers_->backend;
  const int num_tokens = kFixedTokens + num_points;
  if (num_points < 1 || num_tokens > kMaxTokens) {
    return absl::InvalidArgumentError(absl::StrCat("SAM: a prompt has ", num_points,
                                                   " points; at most ", kMaxTokens - kFixedTokens,
                                                   " are possible"));
  }
  const auto num_prompts = static_cast<int>(points.size()) / num_points;
  const int64_t cells = int64_t{extent()} * extent(), num_masks = num_prompts * kPromptMasks;
  masks.num_prompts = num_prompts;
  masks.ious.Reserve(backend, num_masks);
  masks.quarters.Reserve(backend, num_masks * cells);
  masks.bits.Reserve(backend, num_masks * cells / 32);
  masks.areas.Reserve(backend, num_masks * 3);
  masks.logits.Reserve(backend, with_logits ? num_masks * cells : 0);
  const int64_t places = int64_t{side()} * side();
  const int at_once = std::min(DecodedAtOnce(layers_->precision), num_prompts);
  const int64_t rows = int64_t{at_once} * TokenRows(num_tokens);
  const int64_t tokens = int64_t{at_once} * num_tokens * kPromptChannels;
  Scratch& s = *scratch_;
  // Buffers keep their largest size; spans of a run are cut from them.
  const auto room = [&](NetworkBuffer& buffer, int64_t size) {
    if (buffer.size() < size) buffer = NetworkBuffer(backend, layers_->precision, size);
  };
  room(s.places, at_once * places * kPromptChannels);
  for (NetworkBuffer* buffer : {&s.rows, &s.keys, &s.values}) room(*buffer, rows * kPromptChannels);
  const int64_t parts = PlaceParts(static_cast<int>(places));
  s.bias.Reserve(backend, rows);
  s.sums.Reserve(backend, rows * parts * kPromptChannels);
  s.best.Reserve(backend, rows * parts);
  s.total.Reserve(backend, rows * parts);
  s.encoding.Reserve(backend, tokens);
  s.tokens.Reserve(backend, tokens);
  s.products.Reserve(backend, int64_t{at_once} * kPromptMasks * kMaskChannels);
  std::vector<float> coordinates;
  std::vector<int32_t> labels;
  for (const DecoderPoint& point : points) {
    coordinates.insert(coordinates.end(), {point.x, point.y});
    labels.push_back(point.label);
  }
  s.points.Reserve(backend, static_cast<int64_t>(coordinates.size()));
  s.points.Upload(coordinates);
  s.labels.Reserve(backend, static_cast<int64_t>(labels.size()));
  s.labels.Upload(labels);
  RETURN_IF_ERROR(ErrorOf(backend));
  for (int first = 0; first < num_prompts; first += at_once) {
    if (end_ != nullptr && *end_) return absl::CancelledError("SAM: interrupted");
    RunChunk(first, std::min(at_once, num_prompts - first), num_points, grid, masks);
  }
  return ErrorOf(backend);
}

}  // namespace pepeseg
