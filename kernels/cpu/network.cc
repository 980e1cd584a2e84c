#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/math/frame.h"
#include "kernels/math/window.h"

// Layers of image networks (kernels/ops/network.h). A task is kNetworkRows rows, a scanline, or a
// head of a window.

namespace pepeseg {
namespace {

const float* FloatsOf(const ConstNetworkSpan& span) { return static_cast<const float*>(span.data); }
float* FloatsOf(const NetworkSpan& span) { return static_cast<float*>(span.data); }

int64_t NumTasks(int64_t rows) { return (rows + kNetworkRows - 1) / kNetworkRows; }

// Normalises a row to mean 0 and variance 1.
void Normalize(const float* from, int count, float epsilon, float* to) {
  double sum = 0, squares = 0;
  for (int i = 0; i < count; ++i) sum += static_cast<double>(from[i]);
  const double mean = sum / count;
  for (int i = 0; i < count; ++i) {
    const double difference = static_cast<double>(from[i]) - mean;
    squares += difference * difference;
  }
  const double scale = 1 / std::sqrt(squares / count + static_cast<double>(epsilon));
  for (int i = 0; i < count; ++i) {
    to[i] = static_cast<float>((static_cast<double>(from[i]) - mean) * scale);
  }
}

// A product of rows, which a function reads, with weights [in, out].
struct RowProduct {
  int64_t num_rows;
  int in, out;
  const float* weights;
};

// Multiplies rows in tasks of kNetworkRows. read(r, to) fills in row r, [in]; write(r, row) takes
// its product, [out], which it may change.
template <class Read, class Write>
void MultiplyRows(ThreadPool& pool, const SimdKernels& simd, const RowProduct& product, Read read,
                  Write write) {
  struct Memory {
    std::vector<float> rows, products;
  };
  std::vector<Memory> memory(pool.num_threads());
  pool.ParallelFor(NumTasks(product.num_rows), [&](int64_t task, int thread) {
    std::vector<float>&rows = memory[thread].rows, &products = memory[thread].products;
    rows.resize(int64_t{kNetworkRows} * product.in);
    products.resize(int64_t{kNetworkRows} * product.out);
    const int64_t first = task * kNetworkRows;
    const int64_t end = std::min(product.num_rows, first + kNetworkRows);
    for (int64_t r = first; r < end; ++r) read(r, &rows[(r - first) * product.in]);
    simd.multiply_rows({product.in, product.out, rows.data(), product.weights, products.data()});
    for (int64_t r = first; r < end; ++r) write(r, &products[(r - first) * product.out]);
  });
}

// Copies row r of a Linear, or zeros where it is padding.
void ReadRow(const LinearArgs& args, int64_t r, float* to) {
  int64_t from = r;
  if (args.gather) from = PlaceOfToken(args.windows, static_cast<int>(r));
  if (from < 0) {
    std::fill_n(to, args.in, 0.0f);
  } else {
    std::copy_n(FloatsOf(args.input) + from * args.in, args.in, to);
  }
  if (args.normalize) Normalize(to, args.in, args.epsilon, to);
}

// Copies the 9 places around place r of the output.
void ReadNeighborhood(const Convolve3x3Args& args, int64_t r, float* to) {
  const int out_width = ConvolvedExtent(args.width, args.stride);
  const int out_height = ConvolvedExtent(args.height, args.stride);
  const int64_t scanline = r / out_width, image = scanline / out_height;
  for (int tap = 0; tap < 9; ++tap, to += args.in) {
    const int64_t y = scanline % out_height * args.stride + tap / 3 - 1;
    const int64_t x = r % out_width * args.stride + tap % 3 - 1;
    if (y < 0 || y >= args.height || x < 0 || x >= args.width) {
      std::fill_n(to, args.in, 0.0f);
    } else {
      std::copy_n(FloatsOf(args.input) + ((image * args.height + y) * args.width + x) * args.in,
                  args.in, to);
    }
  }
}

void AddTo(const float* values, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] += values[i];
}

bool AreFloats(std::initializer_list<ConstNetworkSpan> spans) {
  return std::ranges::all_of(spans, [](const ConstNetworkSpan& span) {
    return span.empty() || span.precision == Precision::kFloat;
  });
}
constexpr char kOnlyFloats[] = "the CPU's layers of networks take floats only";

}  // namespace

void CpuBackend::PrepareFrame(const PrepareFrameArgs& args) {
  if (!AreFloats({args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  const ScaledPhoto photo = ScaleToExtent(args.photo.data, args.height, args.width, args.extent);
  pool_.ParallelFor(args.extent, [&](int64_t y, int) {
    float* out = FloatsOf(args.output) + y * args.extent * kFrameChannels;
    for (int x = 0; x < args.extent; ++x, out += kFrameChannels) {
      float rgb[3];
      FramePixel(photo, static_cast<int>(y), x, rgb);
      std::fill_n(std::copy_n(rgb, 3, out), kFrameChannels - 3, 0.0f);
    }
  });
}

void CpuBackend::Linear(const LinearArgs& args) {
  assert(args.in % 8 == 0 && args.out % 8 == 0);
  if (!AreFloats({args.input, args.weights, args.residual, args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  MultiplyRows(
      pool_, simd_, {args.rows, args.in, args.out, FloatsOf(args.weights)},
      [&](int64_t r, float* to) { ReadRow(args, r, to); },
      [&](int64_t r, float* row) {
        const int64_t to = args.scatter ? PlaceOfToken(args.windows, static_cast<int>(r)) : r;
        if (to < 0) return;
        if (!args.bias.empty()) AddTo(args.bias.data, args.out, row);
        if (!args.residual.empty()) AddTo(FloatsOf(args.residual) + to * args.out, args.out, row);
        simd_.activate(args.activation, row, args.out);
        std::copy_n(row, args.out, FloatsOf(args.output) + to * args.out);
      });
}

void CpuBackend::LayerNorm(const LayerNormArgs& args) {
  if (!AreFloats({args.input, args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  pool_.ParallelFor(NumTasks(args.rows), [&](int64_t task, int) {
    const int64_t end = std::min(args.rows, (task + 1) * kNetworkRows);
    for (int64_t r = task * kNetworkRows; r < end; ++r) {
      float* out = FloatsOf(args.output) + r * args.channels;
      Normalize(FloatsOf(args.input) + r * args.channels, args.channels, args.epsilon, out);
      for (int c = 0; c < args.channels; ++c) out[c] = out[c] * args.scale[c] + args.shift[c];
    }
  });
}

void CpuBackend::Convolve3x3(const Convolve3x3Args& args) {
  assert(args.in % 8 == 0 && args.out % 8 == 0);
  if (!AreFloats({args.input, args.weights, args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  const int64_t num_rows = int64_t{args.num_images} * ConvolvedExtent(args.height, args.stride) *
                           ConvolvedExtent(args.width, args.stride);
  MultiplyRows(
      pool_, simd_, {num_rows, 9 * args.in, args.out, FloatsOf(args.weights)},
      [&](int64_t r, float* to) { ReadNeighborhood(args, r, to); },
      [&](int64_t r, float* row) {
        if (!args.bias.empty()) AddTo(args.bias.data, args.out, row);
        simd_.activate(args.activation, row, args.out);
        std::copy_n(row, args.out, FloatsOf(args.output) + r * args.out);
      });
}

void CpuBackend::DepthwiseConvolve(const DepthwiseConvolveArgs& args) {
  assert(args.channels % 8 == 0);
  if (!AreFloats({args.input, args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  const int height = ConvolvedExtent(args.height, args.stride);
  pool_.ParallelFor(int64_t{args.num_images} * height, [&](int64_t task, int) {
    simd_.depthwise_scanline(args, static_cast<int>(task / height),
                             static_cast<int>(task % height));
  });
}

void CpuBackend::WindowAttention(const WindowAttentionArgs& args) {
  assert(args.tokens <= kMaxWindowTokens && args.bias_stride >= args.tokens);
  if (!AreFloats({args.qkv, args.bias, args.output})) Fail({kOnlyFloats, true});
  if (failed()) return;
  std::vector<AttentionScratch> scratch(pool_.num_threads());
  pool_.ParallelFor(args.num_windows * args.heads, [&](int64_t task, int thread) {
    simd_.window_attention(args, task / args.heads, static_cast<int>(task % args.heads),
                           scratch[thread]);
  });
}

}  // namespace pepeseg
