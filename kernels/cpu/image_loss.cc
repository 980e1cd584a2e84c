#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/cpu/simd_kernels.h"

namespace pepeseg {
namespace {

// Number of pixels that are not ignored.
int64_t CountPixels(const ImageLossArgs& args) {
  if (args.ignore.empty()) return int64_t{args.width} * args.height;
  return std::count(args.ignore.data, args.ignore.data + args.ignore.size, uint8_t{0});
}

// Returns a band whose scanlines are laid out in `memory`, all zero: the margins must be.
LossBand MakeBand(const ImageLossArgs& args, int64_t num_counted, std::vector<float>& memory) {
  LossBand band = {};
  band.args = &args;
  const float each = num_counted == 0 ? 0 : 1.0f / static_cast<float>(3 * num_counted);
  band.l1_weight = (1 - args.ssim_weight) * each;
  band.ssim_weight = args.ssim_weight * each;
  band.pitch = (args.width + 15) / 16 * 16 + 2 * kRowMargin;
  memory.assign(int64_t{5 + 10 * kRingRows} * band.pitch, 0.0f);
  float* next = memory.data() + kRowMargin;
  const auto take = [&](int num_rows) {
    return std::exchange(next, next + int64_t{num_rows} * band.pitch);
  };
  for (float** row : {&band.squares, &band.product, &band.moment_grad[0], &band.moment_grad[1],
                      &band.moment_grad[2]}) {
    *row = take(1);
  }
  for (float** ring : {&band.x, &band.y, &band.counts}) *ring = take(kRingRows);
  band.moments = take(4 * kRingRows);
  band.gathered = take(3 * kRingRows);
  return band;
}

}  // namespace

// A task is a band of scanlines of one channel (simd/image_loss.cc). Bands have the same height
// whatever the number of threads, and their sums are added in their order. Each thread has working
// memory of its own.
void CpuBackend::ImageLoss(const ImageLossArgs& args) {
  if (failed()) return;
  const int64_t num_counted = CountPixels(args);
  const int bands_per_channel = (args.height + kLossBandRows - 1) / kLossBandRows;
  std::vector<LossBand> bands(int64_t{3} * bands_per_channel);
  std::vector<std::vector<float>> memory(pool_.num_threads());
  pool_.ParallelFor(static_cast<int64_t>(bands.size()), [&](int64_t i, int thread) {
    LossBand& band = bands[i];
    band = MakeBand(args, num_counted, memory[thread]);
    band.channel = static_cast<int>(i / bands_per_channel);
    band.first_row = static_cast<int>(i % bands_per_channel) * kLossBandRows;
    band.end_row = std::min(args.height, band.first_row + kLossBandRows);
    simd_.image_loss_band(band);
  });
  // Floats are summed within a band, doubles over the bands.
  for (int k = 0; k < kNumImageLossSums; ++k) args.sums[k] = 0;
  for (const LossBand& band : bands) {
    for (int k = 0; k < kNumImageLossSums; ++k) args.sums[k] += band.sums[k];
  }
  args.sums[kSumPixelChannels] = static_cast<double>(3 * num_counted);
}

}  // namespace pepeseg
