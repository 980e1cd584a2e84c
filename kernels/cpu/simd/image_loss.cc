#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/cpu/simd_kernels.h"
#include "kernels/math/ssim.h"

// L1, SSIM and their gradients for one band of scanlines of one channel, in one pass down. The
// 11x11 window is separable: each scanline is filtered across into a ring of the last 11, which is
// then filtered down. The gradient of SSIM with respect to a pixel gathers the gradients of all
// windows that hold it, which is the same filter again, through a second ring. A band reads up
// to 10 scanlines above and below itself, so bands are independent of each other.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Weight of the window at distance k from its middle, 0..kSsimRadius.
PEPESEG_HD Lanes Tap(int k) { return Lanes(static_cast<float>(kSsimTaps[k])); }

// Returns scanline `row` of one plane of a ring, [planes, kRingRows, pitch].
PEPESEG_HD float* RingRow(const LossBand& band, float* ring, int plane, int row) {
  const int slot = (row + 4 * kRingRows) % kRingRows;  // rows may be negative
  return ring + int64_t{plane * kRingRows + slot} * band.pitch;
}

// The scanline of both images, and which of its pixels count.
struct ImageRow {
  float *x, *y, *counts;
};
PEPESEG_HD ImageRow ImageRowAt(const LossBand& band, int row) {
  return {RingRow(band, band.x, 0, row), RingRow(band, band.y, 0, row),
          RingRow(band, band.counts, 0, row)};
}

// Writes one channel of `width` pixels of a photograph, as shares of 255.
PEPESEG_HD void LoadChannel(const uint8_t* pixels, int channel, int width, float* out) {
  const hn::CappedTag<uint8_t, 16> bytes;
  const hn::Rebind<uint8_t, FloatTag> lane_bytes;
  const int whole = static_cast<int>(hn::Lanes(bytes)) == 16 ? width & -16 : 0;
  for (int i = 0; i < whole; i += 16) {
    hn::Vec<decltype(bytes)> channels[3];
    hn::LoadInterleaved3(bytes, pixels + 3 * i, channels[0], channels[1], channels[2]);
    alignas(16) uint8_t values[16];
    hn::Store(channels[channel], bytes, values);
    for (int k = 0; k < 16; k += kLanes) {
      const auto integers = hn::PromoteTo(IntTag(), hn::LoadU(lane_bytes, values + k));
      (Lanes(hn::ConvertTo(FloatTag(), integers)) * Lanes(1.0f / 255)).Store(out + i + k);
    }
  }
  for (int i = whole; i < width; ++i) {
    out[i] = static_cast<float>(pixels[3 * i + channel]) * (1.0f / 255);
  }
}

// Loads scanline `row` of both images into the rings. Scanlines outside the image are zero and do
// not count, like the margins. An ignored pixel shows the photograph in both images.
void LoadRow(const LossBand& band, int row) {
  const ImageLossArgs& args = *band.args;
  const int width = args.width;
  const ImageRow out = ImageRowAt(band, row);
  float *const x = out.x, *const y = out.y, *const counts = out.counts;
  if (row < 0 || row >= args.height) {
    for (int i = 0; i < width; ++i) x[i] = y[i] = counts[i] = 0;
    return;
  }
  const int64_t first = int64_t{row} * width;
  const float* color = args.color.data + int64_t{band.channel} * args.height * width + first;
  LoadChannel(args.target.data + 3 * first, band.channel, width, y);
  if (args.ignore.size == 0) {
    for (int i = 0; i < width; i += kLanes) {
      const int left = width - i;
      StoreSome(LoadSome(color + i, left), x + i, left);
      StoreSome(Lanes(1.0f), counts + i, left);
    }
    return;
  }
  const uint8_t* ignore = args.ignore.data + first;
  for (int i = 0; i < width; ++i) {
    counts[i] = ignore[i] == 0 ? 1.0f : 0.0f;
    x[i] = ignore[i] == 0 ? color[i] : y[i];
  }
}

// Filters one scanline across, at kLanes columns from i on.
PEPESEG_HD Lanes FilterAt(const float* in, int i) {
  Lanes sum = Tap(0) * Lanes::Load(in + i);
  for (int k = 1; k <= kSsimRadius; ++k) {
    sum = MulAdd(Tap(k), Lanes::Load(in + i - k) + Lanes::Load(in + i + k), sum);
  }
  return sum;
}

// Filters x and y across: writes the four moments of SsimMoments of scanline `row` to their ring.
void FilterRowMoments(const LossBand& band, int row) {
  float* out[4];
  for (int k = 0; k < 4; ++k) out[k] = RingRow(band, band.moments, k, row);
  const ImageRow in = ImageRowAt(band, row);
  const int width = band.args->width;
  for (int i = 0; i < width; i += kLanes) {
    const Lanes x = Lanes::Load(in.x + i), y = Lanes::Load(in.y + i);
    MulAdd(x, x, y * y).Store(band.squares + i);
    (x * y).Store(band.product + i);
  }
  for (int i = 0; i < width; i += kLanes) {
    FilterAt(in.x, i).Store(out[0] + i);
    FilterAt(in.y, i).Store(out[1] + i);
    FilterAt(band.squares, i).Store(out[2] + i);
    FilterAt(band.product, i).Store(out[3] + i);
  }
}

// Filters one scanline across.
void FilterRow(const float* in, int width, float* out) {
  for (int i = 0; i < width; i += kLanes) FilterAt(in, i).Store(out + i);
}

// The 11 scanlines of one plane of a ring about a middle one.
struct RingColumn {
  const float* rows[kRingRows];
};
PEPESEG_HD RingColumn ColumnAbout(const LossBand& band, float* ring, int plane, int row) {
  RingColumn column;
  for (int k = 0; k < kRingRows; ++k) {
    column.rows[k] = RingRow(band, ring, plane, row + k - kSsimRadius);
  }
  return column;
}
// Filters down, at kLanes columns from i on.
PEPESEG_HD Lanes Filter(const RingColumn& column, int i) {
  Lanes sum = Tap(0) * Lanes::Load(column.rows[kSsimRadius] + i);
  for (int k = 1; k <= kSsimRadius; ++k) {
    const Lanes above = Lanes::Load(column.rows[kSsimRadius - k] + i);
    sum = MulAdd(Tap(k), above + Lanes::Load(column.rows[kSsimRadius + k] + i), sum);
  }
  return sum;
}

// Sums the lanes in double, in their order.
PEPESEG_HD double Sum(Lanes x) {
  float values[kLanes];
  x.Store(values);
  double sum = 0;
  for (const float value : values) sum += static_cast<double>(value);
  return sum;
}

// Returns the sum of SSIM over the windows centred on scanline `row`, and writes the gradients of
// their moments for a loss of -ssim_weight * SSIM. Windows centred on ignored pixels do not count.
double SsimRow(LossBand& band, int row) {
  const bool want_grad = band.args->color_grad.size > 0;
  RingColumn columns[4];
  for (int k = 0; k < 4; ++k) columns[k] = ColumnAbout(band, band.moments, k, row);
  const ImageRow in = ImageRowAt(band, row);
  Lanes total(0.0f);
  for (int i = 0; i < band.args->width; i += kLanes) {
    const SsimMoments<Lanes> moments = {Filter(columns[0], i), Filter(columns[1], i),
                                        Filter(columns[2], i), Filter(columns[3], i)};
    const Lanes counts = Lanes::Load(in.counts + i);
    total = MulAdd(counts, Ssim(moments), total);
    if (!want_grad) continue;
    const auto grad = SsimVjp(moments, Lanes(-band.ssim_weight) * counts);
    grad.x.Store(band.moment_grad[0] + i);
    grad.sum_squares.Store(band.moment_grad[1] + i);
    grad.product.Store(band.moment_grad[2] + i);
  }
  return Sum(total);
}

// Writes the gradient of scanline `row`: that of L1 and, gathered over the windows, that of SSIM.
void GradRow(const LossBand& band, int row) {
  const ImageLossArgs& args = *band.args;
  float* grad = args.color_grad.data + (int64_t{band.channel} * args.height + row) * args.width;
  RingColumn columns[3];
  for (int k = 0; k < 3; ++k) columns[k] = ColumnAbout(band, band.gathered, k, row);
  const ImageRow in = ImageRowAt(band, row);
  const Lanes zero(0.0f), up(band.l1_weight), down(-band.l1_weight);
  for (int i = 0; i < args.width; i += kLanes) {
    const Lanes x = Lanes::Load(in.x + i), target = Lanes::Load(in.y + i);
    const SsimMomentsGrad<Lanes> gathered = {Filter(columns[0], i), Filter(columns[1], i),
                                             Filter(columns[2], i)};
    const Lanes sign = Select(target < x, up, Select(x < target, down, zero));
    const Lanes sum = SsimPixelVjp(gathered, x, target) + sign;
    StoreSome(Lanes::Load(in.counts + i) * sum, grad + i, args.width - i);
  }
}

// Adds |x - y| and its square over scanline `row`.
void AddDifferences(LossBand& band, int row) {
  const ImageRow in = ImageRowAt(band, row);
  Lanes absolute(0.0f), squared(0.0f);
  for (int i = 0; i < band.args->width; i += kLanes) {
    const Lanes difference =
        Lanes::Load(in.counts + i) * (Lanes::Load(in.x + i) - Lanes::Load(in.y + i));
    absolute = absolute + Abs(difference);
    squared = MulAdd(difference, difference, squared);
  }
  band.sums[kSumL1] += Sum(absolute);
  band.sums[kSumSquared] += Sum(squared);
}

// Evaluates the windows centred on scanline `row` and filters the gradients of their moments
// across, into the second ring. Only the band's own scanlines add to its sums.
void WindowRow(LossBand& band, int row) {
  const double ssim = SsimRow(band, row);
  if (row >= band.first_row && row < band.end_row) {
    band.sums[kSumSsim] += ssim;
    AddDifferences(band, row);
  }
  if (band.args->color_grad.size == 0) return;
  const int width = band.args->width;
  for (int k = 0; k < 3; ++k) {
    // The last vector wrote beyond the border, where the margin must be zero.
    for (int i = width; i < width + kLanes; ++i) band.moment_grad[k][i] = 0;
    FilterRow(band.moment_grad[k], width, RingRow(band, band.gathered, k, row));
  }
}

}  // namespace

// Streams down the scanlines. Once scanline r is filtered across, the windows centred on r - 5 are
// complete, and with them the gradients of r - 10, the oldest scanline of the rings.
void ImageLossBand(LossBand& band) {
  const bool want_grad = band.args->color_grad.size > 0;
  const int end = band.end_row + (want_grad ? 2 : 1) * kSsimRadius;
  for (int row = band.first_row - 2 * kSsimRadius; row < end; ++row) {
    LoadRow(band, row);
    FilterRowMoments(band, row);
    const int center = row - kSsimRadius;
    if (center < band.first_row - kSsimRadius) continue;
    WindowRow(band, center);
    const int done = center - kSsimRadius;
    if (!want_grad || done < band.first_row) continue;
    GradRow(band, done);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
