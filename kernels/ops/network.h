#pragma once

#include <cstdint>

#include "kernels/buffer.h"
#include "kernels/network_buffer.h"

// Arguments of the layers of image networks such as TinyViT (Wu et al. 2022), the encoder of a
// small SAM.
//
// Activations are rows of channels: one row a place of an image, in reading order, images one after
// the other (NHWC), or one row a token. Numbers of channels are multiples of 8. All values of a
// call have the same precision, but Linear, Convolve3x3 and LayerNorm may write floats; biases are
// always floats. Sums, and
// everything between reading and writing, are floats. The CPU backend takes floats only. Results of
// an image do not depend on the number of images.

namespace pepeseg {

enum class Activation : uint8_t {
  kNone,
  kRelu,
  kGelu,  // x / 2 (1 + erf(x / sqrt(2))), kernels/math/activation.h
};

// Images cut into square windows. Images are first padded with zeros to the right and below, to
// multiples of `side`. Rows of windows are tokens: windows in reading order, image by image, and
// within a window places in reading order.
struct WindowGrid {
  int num_images = 0, height = 0, width = 0;  // places
  int side = 0;                               // of a window, places

  constexpr int down() const { return (height + side - 1) / side; }  // windows of an image
  constexpr int across() const { return (width + side - 1) / side; }
  constexpr int tokens() const { return side * side; }  // of a window
  constexpr int64_t num_windows() const { return int64_t{num_images} * down() * across(); }
  constexpr int64_t num_tokens() const { return num_windows() * tokens(); }
  constexpr int64_t num_places() const { return int64_t{num_images} * height * width; }
};

// output = activation(norm(input) weights + bias + residual), row by row.
struct LinearArgs {
  int64_t rows = 0;  // of the product: of tokens where rows are gathered or scattered
  int in = 0, out = 0;
  ConstNetworkSpan input = {};        // [rows, in]
  ConstNetworkSpan weights = {};      // [in, out]
  DeviceSpan<const float> bias = {};  // [out]; empty: 0

  // Normalises each input row to mean 0 and variance 1 before the product; scale and shift of a
  // LayerNorm belong into weights and bias. The row itself is multiplied, and then corrected by its
  // mean: column_sums are the sums of the stored weights over `in`. Epsilon is added to the
  // variance.
  bool normalize = false;
  float epsilon = 1e-5f;
  DeviceSpan<const float> column_sums = {};  // [out] where rows are normalised

  // gather: `input` is the images of `windows`, [places, in]; padding is read as rows of zeros.
  // scatter: `residual` and `output` are those images, [places, out]; padding is dropped.
  bool gather = false, scatter = false;
  WindowGrid windows = {};

  ConstNetworkSpan residual = {};  // [rows, out]; empty: 0. May be the memory of `output`
  Activation activation = Activation::kNone;
  NetworkSpan output = {};  // [rows, out]
};

// output = input, each row normalised to mean 0 and variance 1, times scale plus shift.
struct LayerNormArgs {
  int64_t rows = 0;
  int channels = 0;
  ConstNetworkSpan input = {};                     // [rows, channels]
  DeviceSpan<const float> scale = {}, shift = {};  // [channels]
  float epsilon = 1e-5f;
  NetworkSpan output = {};  // [rows, channels]; may be the memory of `input`
};

// Places of the output of a 3x3 convolution along a side: zeros surround the image by one place.
constexpr int ConvolvedExtent(int extent, int stride) { return (extent - 1) / stride + 1; }

// output = activation(convolution of input + bias), dense, 3x3, zeros around the image.
struct Convolve3x3Args {
  int num_images = 0, height = 0, width = 0;  // of the input
  int in = 0, out = 0, stride = 1;            // stride: 1 or 2
  ConstNetworkSpan input = {};                // [images, height, width, in]
  ConstNetworkSpan weights = {};              // [3 down, 3 across, in, out]
  DeviceSpan<const float> bias = {};          // [out]; empty: 0
  Activation activation = Activation::kNone;
  NetworkSpan output = {};  // [images, ConvolvedExtent of height, and of width, out]
};

// As Convolve3x3, each channel by itself.
struct DepthwiseConvolveArgs {
  int num_images = 0, height = 0, width = 0;  // of the input
  int channels = 0, stride = 1;               // stride: 1 or 2
  ConstNetworkSpan input = {};                // [images, height, width, channels]
  DeviceSpan<const float> weights = {};       // [3 down, 3 across, channels]
  DeviceSpan<const float> bias = {};          // [channels]
  Activation activation = Activation::kNone;
  NetworkSpan output = {};  // [images, ConvolvedExtent of height, and of width, channels]
};

inline constexpr int kHeadSize = 32;  // channels of a head of WindowAttention
inline constexpr int kMaxWindowTokens = 208;

// Attention within windows: for each head, output = softmax(q k / sqrt(kHeadSize) + bias) v.
struct WindowAttentionArgs {
  int64_t num_windows = 0;
  int tokens = 0;  // of a window, at most kMaxWindowTokens
  int heads = 0;
  ConstNetworkSpan qkv = {};  // [windows, tokens, heads, q k v, kHeadSize]
  // [heads, tokens, bias_stride] by query and key; bias_stride is at least `tokens`, and even.
  ConstNetworkSpan bias = {};
  int bias_stride = 0;
  NetworkSpan output = {};  // [windows, tokens, heads, kHeadSize]
};

inline constexpr int kFrameChannels = 8;

// Scales a photograph so that its longer side fills a square frame, and normalises it. Scales down
// by the mean over areas and up bilinearly, rounded to bytes, as OpenCV does. A place of the frame
// is red, green and blue, (value - mean) / deviation, and zeros; padding to the right or below is
// all zeros.
struct PrepareFrameArgs {
  DeviceSpan<const uint8_t> photo = {};  // [height, width, 3] RGB
  int height = 0, width = 0;
  int extent = 0;           // side of the frame, pixels
  NetworkSpan output = {};  // [extent, extent, kFrameChannels]
};

}  // namespace pepeseg
