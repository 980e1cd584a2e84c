#pragma once

#include <cstdint>

#include "kernels/math/hd.h"

// Scaling a photograph to bytes as OpenCV's resize does: by INTER_AREA where it shrinks and by
// INTER_LINEAR where it grows, so that networks see the same input with and without OpenCV.

namespace pepeseg {

// An RGB photograph and the size that it is scaled to.
struct ScaledPhoto {
  const uint8_t* pixels;  // [height, width, 3]
  int height, width;
  int to_height, to_width;
};

// Returns the photograph scaled so that its longer side has `extent` pixels, and the other at least
// one. Halves are rounded to even.
inline ScaledPhoto ScaleToExtent(const uint8_t* pixels, int height, int width, int extent) {
  const double scale = static_cast<double>(extent) / (height > width ? height : width);
  const auto scaled = [&](int size) {
    const int to = static_cast<int>(__builtin_nearbyint(size * scale));
    return to < 1 ? 1 : to;
  };
  return {pixels, height, width, scaled(height), scaled(width)};
}

// The pixels [first, first + count) of a side that a scaled pixel covers, and how much of the first
// and the last of them. Shares below a thousandth of a pixel are left out.
struct CoveredPixels {
  int first, count;
  float first_weight, weight, last_weight;
};
PEPESEG_HD CoveredPixels CoveredBy(int pixel, int size, int to_size) {
  const double scale = static_cast<double>(size) / to_size;
  const double begin = pixel * scale, end = begin + scale;
  const double cell = scale < size - begin ? scale : size - begin;
  int last = static_cast<int>(::floor(end));
  if (last > size - 1) last = size - 1;
  int first = static_cast<int>(::ceil(begin));
  if (first > last) first = last;
  CoveredPixels covered = {first, last - first, 0, static_cast<float>(1.0 / cell), 0};
  covered.first_weight = covered.last_weight = covered.weight;
  if (first - begin > 1e-3) {
    covered.first = first - 1;
    ++covered.count;
    covered.first_weight = static_cast<float>((first - begin) / cell);
  }
  if (end - last > 1e-3) {
    ++covered.count;
    double share = end - last < 1.0 ? end - last : 1.0;
    if (share > cell) share = cell;
    covered.last_weight = static_cast<float>(share / cell);
  }
  return covered;
}
PEPESEG_HD float WeightOf(const CoveredPixels& covered, int i) {
  // A single pixel that is both the first and the last is covered whole.
  if (covered.count == 1) return Max(covered.first_weight, covered.last_weight);
  if (i == 0) return covered.first_weight;
  return i == covered.count - 1 ? covered.last_weight : covered.weight;
}

PEPESEG_HD float RoundToByte(float value) { return Max(0.0f, Min(255.0f, ::rintf(value))); }

// Mean over the area of a scaled pixel. A half of the size has its own rounding: halves go up.
PEPESEG_HD void AreaPixel(const ScaledPhoto& photo, int y, int x, float (&rgb)[3]) {
  const bool halved = photo.height == 2 * photo.to_height && photo.width == 2 * photo.to_width;
  const CoveredPixels rows = CoveredBy(y, photo.height, photo.to_height);
  const CoveredPixels columns = CoveredBy(x, photo.width, photo.to_width);
  rgb[0] = rgb[1] = rgb[2] = 0;
  for (int i = 0; i < rows.count; ++i) {
    float sum[3] = {0, 0, 0};
    const uint8_t* at =
        photo.pixels + (static_cast<int64_t>(rows.first + i) * photo.width + columns.first) * 3;
    for (int j = 0; j < columns.count; ++j, at += 3) {
      const float weight = WeightOf(columns, j);
      for (int c = 0; c < 3; ++c) sum[c] += static_cast<float>(at[c]) * weight;
    }
    const float weight = WeightOf(rows, i);
    for (int c = 0; c < 3; ++c) rgb[c] += weight * sum[c];
  }
  for (float& value : rgb) value = halved ? ::floorf(value + 0.5f) : RoundToByte(value);
}

// Two neighbours of a side and their weights, in units of 2^-11.
struct Neighbors {
  int first, second;
  int first_weight, second_weight;
};
PEPESEG_HD Neighbors NeighborsOf(int pixel, int size, int to_size, bool clamp_weight) {
  const double scale = 1.0 / (static_cast<double>(to_size) / size);
  float at = static_cast<float>((pixel + 0.5) * scale - 0.5);
  int first = static_cast<int>(::floorf(at));
  at -= static_cast<float>(first);
  // Beyond the rim the nearest pixel counts alone; rows repeat instead.
  if (clamp_weight && first < 0) at = 0, first = 0;
  if (clamp_weight && first >= size - 1) at = 0, first = size - 1;
  const int second = first + 1 < size - 1 ? first + 1 : size - 1;
  return {first < 0 ? 0 : first, second, static_cast<int>(::rintf((1.0f - at) * 2048.0f)),
          static_cast<int>(::rintf(at * 2048.0f))};
}

// Bilinear interpolation between the four pixels around the centre of a scaled pixel.
PEPESEG_HD void LinearPixel(const ScaledPhoto& photo, int y, int x, float (&rgb)[3]) {
  const Neighbors rows = NeighborsOf(y, photo.height, photo.to_height, false);
  const Neighbors columns = NeighborsOf(x, photo.width, photo.to_width, true);
  const uint8_t* above = photo.pixels + static_cast<int64_t>(rows.first) * photo.width * 3;
  const uint8_t* below = photo.pixels + static_cast<int64_t>(rows.second) * photo.width * 3;
  for (int c = 0; c < 3; ++c) {
    const int left = columns.first * 3 + c, right = columns.second * 3 + c;
    const int upper = above[left] * columns.first_weight + above[right] * columns.second_weight;
    const int lower = below[left] * columns.first_weight + below[right] * columns.second_weight;
    rgb[c] = static_cast<float>(((rows.first_weight * (upper >> 4) >> 16) +
                                 (rows.second_weight * (lower >> 4) >> 16) + 2) >>
                                2);
  }
}

// Pixel of the frame, normalised with the mean and the deviation of SAM's training; zeros where the
// scaled photograph ends.
PEPESEG_HD void FramePixel(const ScaledPhoto& photo, int y, int x, float (&rgb)[3]) {
  constexpr float kMean[3] = {123.675f, 116.28f, 103.53f};
  constexpr float kDeviation[3] = {58.395f, 57.12f, 57.375f};
  rgb[0] = rgb[1] = rgb[2] = 0;
  if (y >= photo.to_height || x >= photo.to_width) return;
  const bool same = photo.to_width == photo.width && photo.to_height == photo.height;
  const bool shrinks = photo.to_width < photo.width || photo.to_height < photo.height;
  if (same) {
    const uint8_t* at = photo.pixels + (static_cast<int64_t>(y) * photo.width + x) * 3;
    for (int c = 0; c < 3; ++c) rgb[c] = static_cast<float>(at[c]);
  } else if (shrinks) {
    AreaPixel(photo, y, x, rgb);
  } else {
    LinearPixel(photo, y, x, rgb);
  }
  for (int c = 0; c < 3; ++c) rgb[c] = (rgb[c] - kMean[c]) / kDeviation[c];
}

}  // namespace pepeseg
