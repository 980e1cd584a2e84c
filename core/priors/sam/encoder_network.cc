#include "core/priors/sam/encoder_network.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/priors/sam/encoder_layers.h"
#include "core/priors/sam/onnx_weights.h"

namespace pepeseg {
namespace {

// Photographs whose last stages run together. The first stages have enough places to fill a GPU
// with one photograph; together they would need eight times the memory.
constexpr int kEncoderBatch = 8;
constexpr float kNeckEpsilon = 1e-6f;

}  // namespace

// The layers, and the memory that they work in.
struct EncoderNetwork::Layers {
  Layers(const EncoderShape& shape_in, Backend& backend_in, Precision precision)
      : shape(shape_in),
        backend(backend_in),
        entry(backend, precision, 0),
        image(backend, precision, 0),
        next(backend, precision, 0),
        wide(backend, precision, 0),
        mixed(backend, precision, 0) {}

  // Places along a side of the images of a stage.
  int extent(int stage) const { return shape.frame / std::array{4, 8, 16, 16}[stage]; }
  int64_t places(int stage) const { return int64_t{extent(stage)} * extent(stage); }
  WindowGrid Windows(int stage, int num_images) const {
    return {num_images, extent(stage), extent(stage), shape.window[stage]};
  }

  bool Reserve(int num_images);
  void RunLinear(const LinearLayer& layer, int64_t rows, ConstNetworkSpan input, NetworkSpan output,
                 Activation activation, ConstNetworkSpan residual = {});
  void RunConvolution(const LinearLayer& layer, int num_images, int side, int stride,
                      ConstNetworkSpan input, NetworkSpan output, Activation activation);
  void RunDepthwise(const DepthwiseLayer& layer, int num_images, int side, ConstNetworkSpan input,
                    NetworkSpan output, Activation activation);
  void RunNorm(const LayerNormLayer& layer, int64_t rows, ConstNetworkSpan input,
               NetworkSpan output);
  void RunBottleneck(const BottleneckLayers& layers, int num_images, int side,
                     ConstNetworkSpan input, ConstNetworkSpan residual, NetworkSpan output);
  void RunAttention(const AttentionLayers& layers, int stage, int num_images);
  void RunFirstStages(const Image& photo, NetworkSpan output);
  void RunLastStages(int num_images, NetworkSpan embeddings);

  EncoderShape shape;
  Backend& backend;
  EncoderLayers weights;
  // Working memory: of the photograph; of the inputs of stage 2; of a stage's images and of those
  // being made from them; of what is four times as wide; and of what is made from that.
  Buffer<uint8_t> photograph;
  NetworkBuffer entry, image, next, wide, mixed;
};

// Sizes the working memory. False when out of memory.
bool EncoderNetwork::Layers::Reserve(int num_images) {
  const int64_t frame = int64_t{shape.frame} * shape.frame;
  const std::array<int, 4> counts = {1, 1, num_images, num_images};
  int64_t of_image = 0;
  int64_t of_wide = frame / 4 * (shape.channels[0] / 2);  // the patch embedding's middle
  int64_t of_mixed = frame * kFrameChannels;              // the frame
  for (int stage = 0; stage < 4; ++stage) {
    const int64_t rows = counts[stage] * places(stage);
    const int channels = shape.channels[stage];
    of_image = std::max(of_image, rows * std::max(channels, stage == 3 ? shape.embedding : 0));
    of_wide = std::max(of_wide, rows * 4 * channels);
    if (stage == 0) of_mixed = std::max(of_mixed, rows * 4 * channels);
    if (stage < 3) {
      const int64_t down = rows * shape.channels[stage + 1];
      of_wide = std::max(of_wide, down);
      of_mixed = std::max(of_mixed, down);
    }
    if (stage == 0) continue;
    const int64_t inner =
        Windows(stage, counts[stage]).num_tokens() * shape.heads[stage] * kHeadSize;
    of_wide = std::max(of_wide, 3 * inner);
    of_mixed = std::max(of_mixed, inner);
  }
  // The three change places, so they have the same size.
  entry.Resize(of_image);
  image.Resize(of_image);
  next.Resize(of_image);
  wide.Resize(of_wide);
  mixed.Resize(of_mixed);
  return entry.size() > 0 && image.size() > 0 && next.size() > 0 && wide.size() > 0 &&
         mixed.size() > 0;
}

void EncoderNetwork::Layers::RunLinear(const LinearLayer& layer, int64_t rows,
                                       ConstNetworkSpan input, NetworkSpan output,
                                       Activation activation, ConstNetworkSpan residual) {
  backend.Linear({.rows = rows,
                  .in = layer.in,
                  .out = layer.out,
                  .input = input,
                  .weights = layer.weights.span(),
                  .bias = layer.bias.span(),
                  .normalize = layer.normalize,
                  .column_sums = layer.column_sums.span(),
                  .residual = residual,
                  .activation = activation,
                  .output = output});
}

void EncoderNetwork::Layers::RunConvolution(const LinearLayer& layer, int num_images, int side,
                                            int stride, ConstNetworkSpan input, NetworkSpan output,
                                            Activation activation) {
  backend.Convolve3x3({.num_images = num_images,
                       .height = side,
                       .width = side,
                       .in = layer.in,
                       .out = layer.out,
                       .stride = stride,
                       .input = input,
                       .weights = layer.weights.span(),
                       .bias = layer.bias.span(),
                       .activation = activation,
                       .output = output});
}

void EncoderNetwork::Layers::RunDepthwise(const DepthwiseLayer& layer, int num_images, int side,
                                          ConstNetworkSpan input, NetworkSpan output,
                                          Activation activation) {
  backend.DepthwiseConvolve({.num_images = num_images,
                             .height = side,
                             .width = side,
                             .channels = layer.channels,
                             .stride = layer.stride,
                             .input = input,
                             .weights = layer.weights.span(),
                             .bias = layer.bias.span(),
                             .activation = activation,
                             .output = output});
}

void EncoderNetwork::Layers::RunNorm(const LayerNormLayer& layer, int64_t rows,
                                     ConstNetworkSpan input, NetworkSpan output) {
  backend.LayerNorm({.rows = rows,
                     .channels = shape.embedding,
                     .input = input,
                     .scale = layer.scale.span(),
                     .shift = layer.shift.span(),
                     .epsilon = kNeckEpsilon,
                     .output = output});
}

// GELU follows each of the first two layers, and the last one only where a residual is added.
void EncoderNetwork::Layers::RunBottleneck(const BottleneckLayers& layers, int num_images, int side,
                                           ConstNetworkSpan input, ConstNetworkSpan residual,
                                           NetworkSpan output) {
  const int64_t rows = int64_t{num_images} * side * side;
  RunLinear(layers.expand, rows, input, wide.span(), Activation::kGelu);
  RunDepthwise(layers.depthwise, num_images, side, wide.span(), mixed.span(), Activation::kGelu);
  const int64_t to = ConvolvedExtent(side, layers.depthwise.stride);
  RunLinear(layers.project, num_images * to * to, mixed.span(), output,
            residual.empty() ? Activation::kNone : Activation::kGelu, residual);
}

// Attention within windows, a depthwise convolution and the MLP, from `image` to `image`.
void EncoderNetwork::Layers::RunAttention(const AttentionLayers& layers, int stage,
                                          int num_images) {
  const WindowGrid windows = Windows(stage, num_images);
  LinearArgs qkv = {.rows = windows.num_tokens(), .in = layers.qkv.in, .out = layers.qkv.out};
  qkv.input = image.span();
  qkv.weights = layers.qkv.weights.span();
  qkv.bias = layers.qkv.bias.span();
  qkv.normalize = true;
  qkv.column_sums = layers.qkv.column_sums.span();
  qkv.gather = true;
  qkv.windows = windows;
  qkv.output = wide.span();
  backend.Linear(qkv);
  backend.WindowAttention({.num_windows = windows.num_windows(),
                           .tokens = windows.tokens(),
                           .heads = shape.heads[stage],
                           .qkv = wide.span(),
                           .bias = layers.bias.span(),
                           .bias_stride = layers.bias_stride,
                           .output = mixed.span()});
  LinearArgs project = {
      .rows = windows.num_tokens(), .in = layers.project.in, .out = layers.project.out};
  project.input = mixed.span();
  project.weights = layers.project.weights.span();
  project.bias = layers.project.bias.span();
  project.scatter = true;
  project.windows = windows;
  project.residual = image.span();
  project.output = image.span();
  backend.Linear(project);
  RunDepthwise(layers.depthwise, num_images, extent(stage), image.span(), next.span(),
               Activation::kNone);
  const int64_t rows = num_images * places(stage);
  RunLinear(layers.widen, rows, next.span(), wide.span(), Activation::kGelu);
  RunLinear(layers.narrow, rows, wide.span(), next.span(), Activation::kNone, next.span());
  std::swap(image, next);
}

// Patch embedding and stages 0 and 1 of one photograph; `output` is its input of stage 2.
void EncoderNetwork::Layers::RunFirstStages(const Image& photo, NetworkSpan output) {
  backend.PrepareFrame({.photo = photograph.span(),
                        .height = photo.height,
                        .width = photo.width,
                        .extent = shape.frame,
                        .output = mixed.span()});
  RunConvolution(weights.first, 1, shape.frame, 2, mixed.span(), wide.span(), Activation::kGelu);
  RunConvolution(weights.second, 1, shape.frame / 2, 2, wide.span(), image.span(),
                 Activation::kNone);
  for (const BottleneckLayers& layers : weights.convolutions) {
    RunBottleneck(layers, 1, extent(0), image.span(), image.span(), image.span());
  }
  RunBottleneck(weights.downsampling[0], 1, extent(0), image.span(), {}, image.span());
  for (const AttentionLayers& layers : weights.attention[0]) RunAttention(layers, 1, 1);
  RunBottleneck(weights.downsampling[1], 1, extent(1), image.span(), {}, output);
}

// Stages 2 and 3 and the neck, from `entry`.
void EncoderNetwork::Layers::RunLastStages(int num_images, NetworkSpan embeddings) {
  std::swap(image, entry);
  for (const AttentionLayers& layers : weights.attention[1]) RunAttention(layers, 2, num_images);
  std::swap(image, entry);
  RunBottleneck(weights.downsampling[2], num_images, extent(2), entry.span(), {}, image.span());
  for (const AttentionLayers& layers : weights.attention[2]) RunAttention(layers, 3, num_images);
  const int64_t rows = num_images * places(3);
  RunLinear(weights.neck, rows, image.span(), next.span(), Activation::kNone);
  RunNorm(weights.neck_norm, rows, next.span(), next.span());
  RunConvolution(weights.neck_convolution, num_images, extent(3), 1, next.span(), image.span(),
                 Activation::kNone);
  RunNorm(weights.last_norm, rows, image.span(), embeddings);
}

EncoderNetwork::EncoderNetwork(std::unique_ptr<Layers> layers) : layers_(std::move(layers)) {}
EncoderNetwork::~EncoderNetwork() = default;
const EncoderShape& EncoderNetwork::shape() const { return layers_->shape; }

absl::StatusOr<std::unique_ptr<EncoderNetwork>> EncoderNetwork::Make(const EncoderShape& shape,
                                                                     WeightSource weights,
                                                                     Backend& backend,
                                                                     Precision precision) {
  auto layers = std::make_unique<Layers>(shape, backend, precision);
  ASSIGN_OR_RETURN(layers->weights, LoadEncoderLayers(shape, weights, backend, precision));
  return std::unique_ptr<EncoderNetwork>(new EncoderNetwork(std::move(layers)));
}

absl::StatusOr<std::unique_ptr<EncoderNetwork>> EncoderNetwork::Load(
    const std::filesystem::path& onnx, Backend& backend, Precision precision) {
  auto weights = OnnxWeights::Read(onnx);
  const auto source = [&](absl::string_view output, int index, std::span<const int64_t> shape) {
    return weights->Input(output, index, shape);
  };
  absl::Status status = weights.status();
  if (status.ok()) {
    auto network = Make({}, source, backend, precision);
    status = network.ok() ? weights->CheckAllRead() : network.status();
    if (status.ok()) return network;
  }
  if (!absl::IsInvalidArgument(status)) return status;
  return absl::FailedPreconditionError(absl::StrCat("SAM: ", status.message()));
}

absl::Status EncoderNetwork::Encode(std::span<const Image* const> photos,
                                    NetworkBuffer* embeddings) {
  Layers& layers = *layers_;
  const int64_t size = layers.shape.embedding_size();
  const auto count = static_cast<int>(photos.size());
  *embeddings = NetworkBuffer(layers.backend, layers.image.precision(), count * size);
  for (int first = 0; first < count; first += kEncoderBatch) {
    const int num_images = std::min(count - first, kEncoderBatch);
    if (!layers.Reserve(num_images)) break;
    const int64_t entry = layers.places(2) * layers.shape.channels[2];
    for (int k = 0; k < num_images; ++k) {
      const Image& photo = *photos[first + k];
      if (!layers.photograph.Reserve(layers.backend, static_cast<int64_t>(photo.pixels.size()))) {
        break;
      }
      layers.photograph.Upload(photo.pixels);
      layers.RunFirstStages(photo, layers.entry.span().Subspan(k * entry, entry));
    }
    layers.RunLastStages(num_images, embeddings->span().Subspan(first * size, num_images * size));
  }
  const std::string error = layers.backend.error();
  if (error.empty()) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("SAM's encoder: ", error));
}

}  // namespace pepeseg
