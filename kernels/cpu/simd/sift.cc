#include "kernels/math/sift.h"

#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"

// The inner loops of SIFT: blurs and differences of scanlines, the search for extrema, and the
// histograms of the windows about a point. Scanlines are padded to a multiple of 16, so that whole
// vectors can be loaded and stored.
//
// A window is walked by scanlines. Gradients, weights and bins of a scanline are computed in
// vectors and written to arrays (WindowRow); then each sample is added to its bins, one after
// another, in the order of the pixels.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kRowFloats = 2 * kMaxSiftWindow + 1 + 16;

// Sum over the rows of tap * row, at kLanes columns from i on.
PEPESEG_HD Lanes Down(const SiftBlurRow& row, const float* taps, int i) {
  const int n = 2 * row.radius + 1;
  Lanes even = Lanes(taps[0]) * Lanes::Load(row.rows[0] + i), odd(0.0f);
  for (int k = 1; k < n; k += 2) {
    odd = MulAdd(Lanes(taps[k]), Lanes::Load(row.rows[k] + i), odd);
    even = MulAdd(Lanes(taps[k + 1]), Lanes::Load(row.rows[k + 1] + i), even);
  }
  return even + odd;
}

// The same along the line.
PEPESEG_HD Lanes Across(const SiftBlurRow& row, const float* taps, int i) {
  const int n = 2 * row.radius + 1;
  const float* in = row.line + i - row.radius;
  Lanes even = Lanes(taps[0]) * Lanes::Load(in), odd(0.0f);
  for (int k = 1; k < n; k += 2) {
    odd = MulAdd(Lanes(taps[k]), Lanes::Load(in + k), odd);
    even = MulAdd(Lanes(taps[k + 1]), Lanes::Load(in + k + 1), even);
  }
  return even + odd;
}

// Samples of one scanline of a window, from column `first` on.
struct WindowRow {
  int count;
  float magnitude[kRowFloats], angle[kRowFloats];
};

// Computes gradients at columns [first, end) of scanline y: central differences, one-sided ones at
// the border of the image.
PEPESEG_HD void Gradients(const SiftWindow& w, int y, int first, int end, WindowRow* row) {
  const float* here = w.level + int64_t{y} * w.stride;
  const float* above = y > 0 ? here - w.stride : here;
  const float* below = y + 1 < w.height ? here + w.stride : here;
  const Lanes half(0.5f), down(y > 0 && y + 1 < w.height ? 0.5f : 1.0f);
  row->count = end - first;
  for (int i = 0; i < row->count; i += kLanes) {
    const int x = first + i;
    Lanes gx = half * (Lanes::Load(here + x + 1) - Lanes::Load(here + x - 1));
    const Lanes gy = down * (Lanes::Load(below + x) - Lanes::Load(above + x));
    if (x == 0 || x + kLanes >= w.width) {
      float fixed[kLanes];
      gx.Store(fixed);
      if (x == 0) fixed[0] = here[1] - here[0];
      const int last = w.width - 1 - x;
      if (last >= 0 && last < kLanes) fixed[last] = here[x + last] - here[x + last - 1];
      gx = Lanes::Load(fixed);
    }
    Sqrt(MulAdd(gx, gx, gy * gy)).Store(row->magnitude + i);
    Atan2(gy, gx).Store(row->angle + i);
  }
}

// Adds a scanline to a histogram of directions of kOrientationBins + 20 bins, where bin k and
// k + kOrientationBins are one.
PEPESEG_HD void AddDirections(const SiftWindow& w, const WindowRow& row, float dy, float first_dx,
                              float radius, float* histogram) {
  const float sigma = kOrientationSpread * w.sigma;
  const Lanes scale(-0.5f / (sigma * sigma)), limit(radius * radius + 0.6f), zero(0.0f);
  float weight[kRowFloats], bin[kRowFloats];
  for (int i = 0; i < row.count; i += kLanes) {
    const Lanes dx = Ramp(first_dx + static_cast<float>(i));
    const Lanes squared = MulAdd(dx, dx, Lanes(dy * dy));
    const Lanes value = Exp(squared * scale) * Lanes::Load(row.magnitude + i);
    Select(squared < limit, value, zero).Store(weight + i);
    const Lanes turn = Lanes::Load(row.angle + i) * Lanes(kOrientationBins / (2 * kPi));
    (turn + Lanes(kOrientationBins - 0.5f)).Store(bin + i);
  }
  for (int i = 0; i < row.count; ++i) {
    const int k = static_cast<int>(bin[i]);
    const float upper = weight[i] * (bin[i] - static_cast<float>(k));
    histogram[k] += weight[i] - upper;
    histogram[k + 1] += upper;
  }
}

using BinTag = hn::CappedTag<float, kDescriptorBins>;
constexpr int kBinLanes = HWY_MIN(HWY_LANES(float), kDescriptorBins);
constexpr int kPadded = kDescriptorCells + 2;  // cells along a side, with one beyond each border

// Weights, cells and directions of a scanline of a descriptor. Cells are counted from the middle of
// the one beyond the border, directions in bins.
struct DescriptorRow {
  float weight[kRowFloats], cell_x[kRowFloats], cell_y[kRowFloats], bin[kRowFloats];
};

PEPESEG_HD void PlaceSamples(const SiftWindow& w, const SiftDirection& direction,
                             const WindowRow& row, float dy, float first_dx, DescriptorRow* out) {
  const float to_cell = 1 / (kDescriptorCell * w.sigma);
  const Lanes c(direction.cosine * to_cell), s(direction.sine * to_cell), y(dy), zero(0.0f);
  const Lanes reach(kDescriptorReach), most(2 * kDescriptorReach - 1e-4f);
  const Lanes bins(static_cast<float>(kDescriptorBins));
  for (int i = 0; i < row.count; i += kLanes) {
    const Lanes dx = Ramp(first_dx + static_cast<float>(i));
    const Lanes nx = MulAdd(c, dx, s * y), ny = NegMulAdd(s, dx, c * y);
    const auto inside = (Abs(nx) < reach) & (Abs(ny) < reach);
    const Lanes window = Exp(Lanes(-0.125f) * MulAdd(nx, nx, ny * ny));
    Select(inside, window * Lanes::Load(row.magnitude + i), zero).Store(out->weight + i);
    Min(Max(nx + reach, zero), most).Store(out->cell_x + i);
    Min(Max(ny + reach, zero), most).Store(out->cell_y + i);
    // Two turns are added to keep the difference positive, and then taken away again.
    Lanes bin =
        (Lanes::Load(row.angle + i) - Lanes(direction.angle)) * Lanes(kDescriptorBins / (2 * kPi)) +
        bins + bins;
    bin = Select(bin < bins, bin, bin - bins);
    Select(bin < bins, bin, bin - bins).Store(out->bin + i);
  }
}

// Adds samples to the 2x2 cells about them, and there to the two nearest directions. All directions
// of a cell are one vector.
PEPESEG_HD void AddSamples(const DescriptorRow& row, int count, float* cells) {
  const BinTag d;
  const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
  const auto turn = hn::Set(d, static_cast<float>(kDescriptorBins));
  for (int i = 0; i < count; ++i) {
    if (row.weight[i] == 0) continue;
    const int x = static_cast<int>(row.cell_x[i]), y = static_cast<int>(row.cell_y[i]);
    const float right = row.cell_x[i] - static_cast<float>(x);
    const float lower = row.cell_y[i] - static_cast<float>(y);
    const float below = row.weight[i] * lower, above = row.weight[i] - below;
    float* cell = cells + (y * kPadded + x) * kDescriptorBins;
    HWY_UNROLL(2)
    for (int k = 0; k < kDescriptorBins; k += kBinLanes) {
      const auto away =
          hn::Abs(hn::Sub(hn::Set(d, row.bin[i]), hn::Iota(d, static_cast<float>(k))));
      const auto share = hn::Max(zero, hn::Sub(one, hn::Min(away, hn::Sub(turn, away))));
      const auto add = [&](float* to, float weight) HWY_ATTR {
        hn::StoreU(hn::MulAdd(hn::Set(d, weight), share, hn::LoadU(d, to + k)), d, to + k);
      };
      add(cell, above - above * right);
      add(cell + kDescriptorBins, above * right);
      add(cell + kPadded * kDescriptorBins, below - below * right);
      add(cell + (kPadded + 1) * kDescriptorBins, below * right);
    }
  }
}

// Narrows [first, end) to the columns dx from a point for which |a dx + b| < bound can hold.
PEPESEG_HD void Narrow(float a, float b, float bound, float* first, float* end) {
  if (a < 0) a = -a, b = -b;
  if (a < 1e-6f) return;
  *first = Max(*first, (-bound - b) / a);
  *end = Min(*end, (bound - b) / a);
}

// Writes the clamped and normalised histogram of the cells as bytes.
void WriteDescriptor(const float* cells, uint8_t* descriptor) {
  float squares = 0;
  for (int y = 1; y <= kDescriptorCells; ++y) {
    const float* row = cells + (y * kPadded + 1) * kDescriptorBins;
    for (int k = 0; k < kDescriptorCells * kDescriptorBins; ++k) squares += row[k] * row[k];
  }
  const float limit = kDescriptorClamp * Sqrt(squares);
  float sum = 0;
  for (int y = 1; y <= kDescriptorCells; ++y) {
    const float* row = cells + (y * kPadded + 1) * kDescriptorBins;
    for (int k = 0; k < kDescriptorCells * kDescriptorBins; ++k) sum += Min(row[k], limit);
  }
  for (int y = 0; y < kDescriptorCells; ++y) {
    for (int x = 0; x < kDescriptorCells; ++x) {
      const float* cell = cells + ((y + 1) * kPadded + x + 1) * kDescriptorBins;
      for (int k = 0; k < kDescriptorBins; ++k) {
        descriptor[DescriptorIndex(y, x, k)] = RootSiftByte(Min(cell[k], limit), sum);
      }
    }
  }
}

}  // namespace

void BlurSiftRow(const SiftBlurRow& row) {
  float taps[2 * kMaxSiftRadius + 1];
  for (int k = -row.radius; k <= row.radius; ++k) taps[k + row.radius] = row.taps[k < 0 ? -k : k];
  for (int i = 0; i < row.width; i += kLanes) Down(row, taps, i).Store(row.line + i);
  for (int k = 1; k <= row.radius; ++k) row.line[-k] = row.line[0];
  for (int k = 0; k < row.radius; ++k) row.line[row.width + k] = row.line[row.width - 1];
  for (int i = 0; i < row.width; i += kLanes) Across(row, taps, i).Store(row.out + i);
}

void SiftDifferences(const float* const* levels, int width, float* const* out) {
  for (int i = 0; i < width; i += kLanes) {
    Lanes below = Lanes::Load(levels[0] + i);
    for (int k = 0; k + 1 < kSiftLevels; ++k) {
      const Lanes above = Lanes::Load(levels[k + 1] + i);
      (above - below).Store(out[k] + i);
      below = above;
    }
  }
}

// Most pixels fail the threshold or the comparison with their neighbours in the scanline.
int SiftExtrema(const SiftExtremaRow& row, int32_t* columns) {
  const Lanes threshold(row.threshold), zero(0.0f);
  int count = 0;
  for (int x = 1; x < row.width - 1; x += kLanes) {
    const Lanes v = Lanes::Load(row.dog[1][1] + x);
    LaneMask maximum = threshold <= v, minimum = v <= zero - threshold;
    for (int k = 0; k < 27; ++k) {
      // The scanline itself comes first, then those above and below, then the other scales.
      constexpr int8_t kOrder[9] = {4, 3, 5, 1, 7, 0, 2, 6, 8};
      const int of = kOrder[k / 3], dx = k % 3 - 1;
      if (k == 1) continue;  // the pixel itself
      if (dx == -1 && None(maximum | minimum)) break;
      const Lanes other = Lanes::Load(row.dog[of / 3][of % 3] + x + dx);
      maximum = maximum & (other < v);
      minimum = minimum & (v < other);
    }
    uint32_t found = BitsOf(maximum | minimum);
    for (; found != 0; found &= found - 1) {
      const int at = x + __builtin_ctz(found);
      if (at < row.width - 1) columns[count++] = at;
    }
  }
  return count;
}

void SiftDirections(const SiftWindow& w, float* histogram) {
  float bins[kOrientationBins + 20] = {};
  const int radius = OrientationRadius(w.sigma);
  const int xi = static_cast<int>(w.x + 0.5f), yi = static_cast<int>(w.y + 0.5f);
  const int first = Max(0, xi - radius), end = Min(w.width, xi + radius + 1);
  for (int y = Max(0, yi - radius); y < Min(w.height, yi + radius + 1); ++y) {
    WindowRow row;
    Gradients(w, y, first, end, &row);
    AddDirections(w, row, static_cast<float>(y) - w.y, static_cast<float>(first) - w.x,
                  static_cast<float>(radius), bins);
  }
  for (int k = 0; k < kOrientationBins; ++k) {
    histogram[k] = bins[k] + (k < 20 ? bins[k + kOrientationBins] : 0);
  }
  SmoothDirections(histogram);
}

void SiftDescriptor(const SiftWindow& w, const SiftDirection& direction, uint8_t* descriptor) {
  alignas(64) float cells[kPadded * kPadded * kDescriptorBins] = {};
  const int radius = DescriptorRadius(w.sigma);
  const int xi = static_cast<int>(w.x + 0.5f), yi = static_cast<int>(w.y + 0.5f);
  const float bound = kDescriptorReach * kDescriptorCell * w.sigma;
  for (int y = Max(1, yi - radius); y < Min(w.height - 1, yi + radius + 1); ++y) {
    const float dy = static_cast<float>(y) - w.y;
    float from = static_cast<float>(Max(1, xi - radius)) - w.x;
    float to = static_cast<float>(Min(w.width - 2, xi + radius)) - w.x;
    Narrow(direction.cosine, direction.sine * dy, bound, &from, &to);
    Narrow(-direction.sine, direction.cosine * dy, bound, &from, &to);
    const int first = static_cast<int>(__builtin_ceilf(from + w.x));
    const int end = static_cast<int>(__builtin_floorf(to + w.x)) + 1;
    if (first >= end) continue;
    WindowRow row;
    DescriptorRow samples;
    Gradients(w, y, first, end, &row);
    PlaceSamples(w, direction, row, dy, static_cast<float>(first) - w.x, &samples);
    AddSamples(samples, row.count, cells);
  }
  WriteDescriptor(cells, descriptor);
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
