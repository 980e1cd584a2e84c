#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/activation.h"

// Inner loops of the layers of networks (kernels/ops/network.h). Lanes are output channels, except
// in attention's scores, where they are keys. A sum runs over its terms in their order.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Rows and vectors of outputs whose sums are kept in registers: with AVX-512 half of its 32, so
// that broadcasts are fewer than products.
constexpr int kRowsAtOnce = kLanes == 16 ? 8 : 4, kVectorsAtOnce = 2;
constexpr int kColumns = kVectorsAtOnce * kLanes;
constexpr int kPanelRows = 256;  // of the weights that are copied together; fits the first cache

// Some columns of the weights, next to each other. In place, rows of a power of two in length would
// use few sets of the cache.
struct Panel {
  alignas(64) float values[kPanelRows * kColumns];
  int count;  // rows
};

// Copies `count` columns of rows [first, first + panel.count); columns beyond are 0.
PEPESEG_HD void CopyPanel(const RowsProduct& job, int first, int column, int count, Panel& panel) {
  const float* from = job.weights + static_cast<int64_t>(first) * job.out + column;
  float* to = panel.values;
  for (int k = 0; k < panel.count; ++k, from += job.out, to += kColumns) {
    if (count == kColumns) {
      HWY_UNROLL(kVectorsAtOnce)
      for (int v = 0; v < kVectorsAtOnce; ++v)
        Lanes::Load(from + v * kLanes).Store(to + v * kLanes);
    } else {
      for (int c = 0; c < kColumns; ++c) to[c] = c < count ? from[c] : 0.0f;
    }
  }
}

// Adds the products of kRowsAtOnce rows with the panel to sums, [kRowsAtOnce, job.out], or sets
// them.
PEPESEG_HD void MultiplyPanel(const RowsProduct& job, const float* rows, const Panel& panel,
                              bool adds, int count, float* products) {
  Lanes sums[kRowsAtOnce][kVectorsAtOnce];
  HWY_UNROLL(kRowsAtOnce)
  for (int r = 0; r < kRowsAtOnce; ++r) {
    HWY_UNROLL(kVectorsAtOnce)
    for (int v = 0; v < kVectorsAtOnce; ++v) {
      sums[r][v] =
          adds ? LoadSome(products + r * job.out + v * kLanes, count - v * kLanes) : Lanes(0.0f);
    }
  }
  const float* weights = panel.values;
  for (int k = 0; k < panel.count; ++k, weights += kColumns) {
    Lanes w[kVectorsAtOnce];
    HWY_UNROLL(kVectorsAtOnce)
    for (int v = 0; v < kVectorsAtOnce; ++v) w[v] = Lanes::Load(weights + v * kLanes);
    HWY_UNROLL(kRowsAtOnce)
    for (int r = 0; r < kRowsAtOnce; ++r) {
      const Lanes x(rows[r * job.in + k]);
      HWY_UNROLL(kVectorsAtOnce)
      for (int v = 0; v < kVectorsAtOnce; ++v) sums[r][v] = MulAdd(x, w[v], sums[r][v]);
    }
  }
  HWY_UNROLL(kRowsAtOnce)
  for (int r = 0; r < kRowsAtOnce; ++r) {
    HWY_UNROLL(kVectorsAtOnce)
    for (int v = 0; v < kVectorsAtOnce; ++v) {
      StoreSome(sums[r][v], products + r * job.out + v * kLanes, count - v * kLanes);
    }
  }
}

template <class F>
PEPESEG_HD void ForEachVector(float* values, int64_t count, const F& f) {
  for (int64_t i = 0; i < count; i += kLanes) {
    const int some = static_cast<int>(Min(static_cast<int64_t>(kLanes), count - i));
    StoreSome(f(LoadSome(values + i, some)), values + i, some);
  }
}

}  // namespace

void MultiplyRows(const RowsProduct& job) {
  Panel panel;
  for (int column = 0; column < job.out; column += kColumns) {
    const int count = Min(kColumns, job.out - column);
    for (int first = 0; first < job.in; first += kPanelRows) {
      panel.count = Min(kPanelRows, job.in - first);
      CopyPanel(job, first, column, count, panel);
      for (int row = 0; row < kNetworkRows; row += kRowsAtOnce) {
        MultiplyPanel(job, job.rows + row * job.in + first, panel, first > 0, count,
                      job.products + row * job.out + column);
      }
    }
  }
}

void Activate(Activation activation, float* values, int64_t count) {
  if (activation == Activation::kRelu) {
    ForEachVector(values, count, [](Lanes x) { return Max(x, Lanes(0.0f)); });
  } else if (activation == Activation::kGelu) {
    ForEachVector(values, count, [](Lanes x) { return Gelu(x); });
  }
}

void DepthwiseScanline(const DepthwiseConvolveArgs& args, int image, int y) {
  const int64_t channels = args.channels;
  const int width = ConvolvedExtent(args.width, args.stride);
  const int height = ConvolvedExtent(args.height, args.stride);
  const float* input = static_cast<const float*>(args.input.data) +
                       int64_t{image} * args.height * args.width * channels;
  float* output =
      static_cast<float*>(args.output.data) + (int64_t{image} * height + y) * width * channels;
  for (int x = 0; x < width; ++x) {
    for (int c = 0; c < args.channels; c += kLanes) {
      const int count = Min(kLanes, args.channels - c);
      Lanes sum = LoadSome(args.bias.data + c, count);
      for (int tap = 0; tap < 9; ++tap) {
        const int from_y = y * args.stride + tap / 3 - 1, from_x = x * args.stride + tap % 3 - 1;
        if (from_y < 0 || from_y >= args.height || from_x < 0 || from_x >= args.width) continue;
        const float* at = input + (int64_t{from_y} * args.width + from_x) * channels + c;
        sum = MulAdd(LoadSome(at, count), LoadSome(args.weights.data + tap * channels + c, count),
                     sum);
      }
      StoreSome(sum, output + x * channels + c, count);
    }
  }
  Activate(args.activation, output, width * channels);
}

// The keys are transposed, so that the scores of a query with kLanes keys are summed at once.
void AttendWindow(const WindowAttentionArgs& args, int64_t window, int head,
                  AttentionScratch& scratch) {
  constexpr float kLeast = -1e30f;
  const int tokens = args.tokens;
  const int64_t row = int64_t{args.heads} * 3 * kHeadSize;
  const float* q = static_cast<const float*>(args.qkv.data) + window * tokens * row +
                   int64_t{head} * 3 * kHeadSize;
  const float* k = q + kHeadSize;
  const float* v = k + kHeadSize;
  const int padded = (tokens + kLanes - 1) / kLanes * kLanes;
  for (int c = 0; c < kHeadSize; ++c) {
    for (int t = 0; t < padded; ++t) scratch.keys[c][t] = t < tokens ? k[t * row + c] : 0;
  }
  const Lanes scale(0.17677669f);  // 1 / sqrt(kHeadSize)
  for (int t = 0; t < tokens; ++t) {
    const float* bias =
        static_cast<const float*>(args.bias.data) + (int64_t{head} * tokens + t) * args.bias_stride;
    Lanes largest(kLeast);
    for (int key = 0; key < padded; key += kLanes) {
      Lanes sum(0.0f);
      for (int c = 0; c < kHeadSize; ++c) {
        sum = MulAdd(Lanes(q[t * row + c]), Lanes::Load(scratch.keys[c] + key), sum);
      }
      sum = MulAdd(sum, scale, LoadSome(bias + key, tokens - key));
      const LaneMask inside = Ramp(static_cast<float>(key)) < Lanes(static_cast<float>(tokens));
      sum = Select(inside, sum, Lanes(kLeast));
      largest = Max(largest, sum);
      sum.Store(scratch.scores + key);
    }
    const Lanes most(hn::MaxOfLanes(FloatTag(), largest.v));
    Lanes total(0.0f);
    for (int key = 0; key < padded; key += kLanes) {
      const Lanes probability = Exp(Lanes::Load(scratch.scores + key) - most);
      total = total + probability;
      probability.Store(scratch.scores + key);
    }
    const Lanes inverse = Lanes(1.0f) / Total(total);
    float* output = static_cast<float*>(args.output.data) +
                    ((window * tokens + t) * args.heads + head) * kHeadSize;
    FeatureLanes sum = ZeroFeature();
    for (int key = 0; key < tokens; ++key) AddScaled(scratch.scores[key], v + key * row, sum);
    for (int i = 0; i < kVectors; ++i) (sum.v[i] * inverse).Store(output + i * kLanes);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
