#include "kernels/sift_scales.h"

#include <algorithm>
#include <cmath>

namespace pepeseg {
namespace {

constexpr int64_t kSlack = 64;           // floats in front of and behind an octave
constexpr int64_t kAlign = 16;           // floats of the widest vector
constexpr double kPhotographBlur = 0.5;  // blur of a photograph, pixels (Lowe 2004, section 3.3)

using Kernel = std::vector<double>;  // all taps, of odd number

// A Gaussian cut at 4 sigma.
Kernel Gaussian(double sigma) {
  const int radius = static_cast<int>(std::ceil(4 * sigma));
  Kernel taps(2 * radius + 1);
  double sum = 0;
  for (int k = -radius; k <= radius; ++k) {
    sum += taps[k + radius] = std::exp(-0.5 * k * k / (sigma * sigma));
  }
  for (double& tap : taps) tap /= sum;
  return taps;
}

// Blur that leads from one standard deviation to another.
Kernel Between(double from, double to) { return Gaussian(std::sqrt(to * to - from * from)); }

double LevelSigma(int level) { return kSiftBaseSigma * std::exp2(level / double{kSiftStep}); }

// Returns the kernel of two blurs, one after the other.
Kernel After(const Kernel& a, const Kernel& b) {
  Kernel both(a.size() + b.size() - 1);
  for (size_t i = 0; i < a.size(); ++i) {
    for (size_t j = 0; j < b.size(); ++j) both[i + j] += a[i] * b[j];
  }
  return both;
}

// Keeps the middle taps, at most kMaxSiftRadius on each side, and only those that
// count in float next to the largest.
SiftTaps TapsOf(const Kernel& kernel) {
  const int middle = static_cast<int>(kernel.size() / 2);
  SiftTaps taps = {};
  taps.radius = std::min(middle, kMaxSiftRadius);
  while (taps.radius > 0 && kernel[middle + taps.radius] < 1e-7) --taps.radius;
  double sum = kernel[middle];
  for (int k = 1; k <= taps.radius; ++k) sum += 2 * kernel[middle + k];
  for (int k = 0; k <= taps.radius; ++k) {
    taps.tap[k] = static_cast<float>(kernel[middle + k] / sum);
  }
  return taps;
}

}  // namespace

std::vector<SiftOctave> SiftOctaves(int width, int height) {
  std::vector<SiftOctave> octaves;
  for (int k = 0; k < kSiftOctaves; ++k) {
    SiftOctave octave = {};
    octave.width = k == 0 ? 2 * width : width >> (k - 1);
    octave.height = k == 0 ? 2 * height : height >> (k - 1);
    if (std::min(width, height) < 3 || std::min(octave.width, octave.height) < 3) break;
    octave.stride = (octave.width + kAlign - 1) / kAlign * kAlign;
    octave.step = std::ldexp(0.5f, k);
    octaves.push_back(octave);
  }
  return octaves;
}

int64_t SiftLevelFloats(std::span<const SiftOctave> octaves) {
  int64_t floats = 0;
  for (const SiftOctave& octave : octaves) floats += kSiftLevels * octave.plane() + 2 * kSlack;
  return floats;
}

void PlaceSiftOctaves(float* memory, std::span<SiftOctave> octaves) {
  for (SiftOctave& octave : octaves) {
    octave.data = memory + kSlack;
    memory = octave.data + kSiftLevels * octave.plane() + kSlack;
  }
}

SiftTaps SiftLevelTaps(int level) {
  return TapsOf(Between(LevelSigma(level - 1), LevelSigma(level)));
}

SiftTaps SiftFinestTaps() { return TapsOf(Between(2 * kPhotographBlur, LevelSigma(0))); }

// Upsampling by 2, linear, then the blurs of octave -1 to the level that is twice as blurred as its
// first, then every second pixel.
SiftTaps SiftPhotographTaps() {
  Kernel fine = After({0.5, 1, 0.5}, Between(2 * kPhotographBlur, LevelSigma(0)));
  for (int level = 1; level <= kSiftStep; ++level) {
    fine = After(fine, Between(LevelSigma(level - 1), LevelSigma(level)));
  }
  const int middle = static_cast<int>(fine.size() / 2), radius = middle / 2;
  Kernel coarse(2 * radius + 1);
  for (int k = -radius; k <= radius; ++k) coarse[k + radius] = fine[middle + 2 * k];
  return TapsOf(coarse);
}

int FirstSiftScale(const std::vector<int64_t>& count, int64_t max_features) {
  int64_t num_points = 0;
  for (int scale = static_cast<int>(count.size()) - 1; scale >= 0; --scale) {
    num_points += count[scale];
    if (num_points > max_features) return scale;
  }
  return 0;
}

}  // namespace pepeseg
