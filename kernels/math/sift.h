#pragma once

#include "kernels/math/hd.h"
#include "kernels/ops/sift.h"

// Formulas of SIFT (Lowe 2004) with VLFeat's constants: where an extremum of the difference of
// Gaussians lies, the directions of a point, and its descriptor. Pixels here are those of an
// octave, and the centre of its first pixel is (0, 0).

namespace pepeseg {

inline constexpr float kSiftContrast = 0.02f / 3;  // least difference of Gaussians, of white 1
inline constexpr float kSiftEdge = 10;             // greatest ratio of the principal curvatures

inline constexpr int kOrientationBins = 36;
inline constexpr float kOrientationSpread = 1.5f;  // of the window, in scales of the point
inline constexpr int kMaxOrientations = 2;
inline constexpr int kDescriptorCells = 4;       // along each side
inline constexpr int kDescriptorBins = 8;        // directions of a cell
inline constexpr float kDescriptorCell = 3;      // side of a cell, in scales of the point
inline constexpr float kDescriptorClamp = 0.2f;  // of a value, in lengths of the descriptor
// Distance from the middle at which a sample no longer reaches a cell, in cells.
inline constexpr float kDescriptorReach = kDescriptorCells / 2 + 0.5f;
// Bound on the radius of both windows, for working memory: the largest scale is below
// 1.6 * 2^(4.5 / 3) pixels of its octave.
inline constexpr int kMaxSiftWindow = 50;

inline constexpr float kPi = 3.14159265358979f;

// Returns the angle of (x, y) in [-pi, pi] to 2e-6; 0 for (0, 0). A minimax polynomial on [0, 1]
// and the symmetries of the circle.
template <class T>
PEPESEG_HD T Atan2(T y, T x) {
  const T ax = Abs(x), ay = Abs(y);
  const T a = Min(ax, ay) / Max(Max(ax, ay), T(1e-30f));
  const T s = a * a;
  T p = MulAdd(s, T(-0.01172120f), T(0.05265332f));
  p = MulAdd(s, p, T(-0.11643287f));
  p = MulAdd(s, p, T(0.19354346f));
  p = MulAdd(s, p, T(-0.33262347f));
  T angle = a * MulAdd(s, p, T(0.99997726f));
  angle = Select(ax < ay, T(0.5f * kPi) - angle, angle);
  angle = Select(x < T(0), T(kPi) - angle, angle);
  return Select(y < T(0), T(0) - angle, angle);
}

// A quadratic through 3x3x3 values: where its extremum is, relative to the middle, and its value
// there.
struct SiftFit {
  double dx, dy, ds;
  double value;
  bool is_edge;  // the curvatures differ by more than kSiftEdge, or in sign
};

// Fits the values d[(s * 3 + y) * 3 + x] by central differences (Lowe 2004, section 4). A singular
// fit has its extremum in the middle.
PEPESEG_HD SiftFit FitExtremum(const float* d) {
  const double middle = d[13];
  const double gx = 0.5 * (d[14] - d[12]), gy = 0.5 * (d[16] - d[10]), gs = 0.5 * (d[22] - d[4]);
  const double xx = d[14] + d[12] - 2 * middle, yy = d[16] + d[10] - 2 * middle;
  const double ss = d[22] + d[4] - 2 * middle;
  const double xy = 0.25 * (d[17] + d[9] - d[15] - d[11]);
  const double xs = 0.25 * (d[23] + d[3] - d[21] - d[5]);
  const double ys = 0.25 * (d[25] + d[1] - d[19] - d[7]);
  // The adjugate of the symmetric matrix of second derivatives.
  const double a00 = yy * ss - ys * ys, a01 = xs * ys - xy * ss, a02 = xy * ys - xs * yy;
  const double a11 = xx * ss - xs * xs, a12 = xy * xs - xx * ys, a22 = xx * yy - xy * xy;
  const double determinant = xx * a00 + xy * a01 + xs * a02;
  SiftFit fit = {0, 0, 0, middle, false};
  if (Abs(determinant) > 1e-30) {
    fit.dx = -(a00 * gx + a01 * gy + a02 * gs) / determinant;
    fit.dy = -(a01 * gx + a11 * gy + a12 * gs) / determinant;
    fit.ds = -(a02 * gx + a12 * gy + a22 * gs) / determinant;
  }
  fit.value += 0.5 * (gx * fit.dx + gy * fit.dy + gs * fit.ds);
  const double trace = xx + yy, limit = (kSiftEdge + 1.0) * (kSiftEdge + 1.0) / kSiftEdge;
  fit.is_edge = !(a22 > 0 && trace * trace < limit * a22);
  return fit;
}

// A point of an octave.
struct SiftPoint {
  float x, y;   // pixels of the octave
  float sigma;  // blur, pixels of the octave
  int level;    // of the octave, 1..kSiftStep; gradients are taken there
};

// A point, the octave that it is in, and where it is in the photograph. Its angle comes later.
struct SiftFound {
  SiftPoint in_octave;
  int octave;  // 0: the finest, octave -1
  SiftKeypoint keypoint;

  // Index of its scale, 0: the finest.
  PEPESEG_HD int scale() const { return octave * kSiftStep + in_octave.level - 1; }
};

// Refines an extremum at pixel (x, y) of difference `level`, which is level + 1 less level. Moves
// by whole pixels, never between scales, while the fit lies more than 0.6 pixels away, five times
// at most. `dog` returns a value by dog(x, y, level). Returns false if the point is too weak, an
// edge, or not where it was searched.
template <class Dog>
PEPESEG_HD bool RefineExtremum(const Dog& dog, int width, int height, int x, int y, int level,
                               SiftPoint* point) {
  SiftFit fit = {};
  for (int step = 0;; ++step) {
    float d[27];
    for (int k = 0; k < 27; ++k) d[k] = dog(x + k % 3 - 1, y + k / 3 % 3 - 1, level + k / 9 - 1);
    fit = FitExtremum(d);
    const int move_x = (fit.dx > 0.6 && x < width - 2) - (fit.dx < -0.6 && x > 1);
    const int move_y = (fit.dy > 0.6 && y < height - 2) - (fit.dy < -0.6 && y > 1);
    if (step == 4 || (move_x == 0 && move_y == 0)) break;
    x += move_x;
    y += move_y;
  }
  const double px = x + fit.dx, py = y + fit.dy;
  *point = {static_cast<float>(px), static_cast<float>(py),
            static_cast<float>(kSiftBaseSigma * Exp2((level + fit.ds) / kSiftStep)), level};
  // Written so that NaN is refused.
  return Abs(fit.value) > static_cast<double>(kSiftContrast) && !fit.is_edge && Abs(fit.dx) < 1.5 &&
         Abs(fit.dy) < 1.5 && Abs(fit.ds) < 1.5 && px >= 0 && px <= width - 1 && py >= 0 &&
         py <= height - 1;
}

// Returns a point in pixels of the photograph, without its angle. `step` is the number of those for
// each pixel of the octave.
PEPESEG_HD SiftKeypoint ToPhotograph(const SiftPoint& point, float step) {
  return {point.x * step + 0.5f, point.y * step + 0.5f, point.sigma * step, 0};
}

// Radius of the window for directions, in pixels.
PEPESEG_HD int OrientationRadius(float sigma) {
  return static_cast<int>(Max(1.0f, 3 * kOrientationSpread * sigma));
}
// Radius of the window for the descriptor, at any angle.
PEPESEG_HD int DescriptorRadius(float sigma) {
  return static_cast<int>(1.41421356f * kDescriptorCell * sigma * kDescriptorReach + 0.5f);
}

// Returns a bin of a histogram of directions after one pass of a box filter over three bins.
PEPESEG_HD float SmoothedDirection(const float* histogram, int k) {
  return (histogram[(k + kOrientationBins - 1) % kOrientationBins] + histogram[k] +
          histogram[(k + 1) % kOrientationBins]) *
         (1.0f / 3);
}
inline constexpr int kDirectionPasses = 6;

// Smooths a histogram of directions.
PEPESEG_HD void SmoothDirections(float* histogram) {
  for (int pass = 0; pass < kDirectionPasses; ++pass) {
    float smooth[kOrientationBins];
    for (int k = 0; k < kOrientationBins; ++k) smooth[k] = SmoothedDirection(histogram, k);
    for (int k = 0; k < kOrientationBins; ++k) histogram[k] = smooth[k];
  }
}

// Returns the number of peaks of a smoothed histogram of directions that are at least 0.8 of the
// highest, and writes their angles in [0, 2 pi), ascending, by a parabola through three bins. Of
// more than kMaxOrientations those of the lowest bins are taken, as COLMAP does.
PEPESEG_HD int OrientationPeaks(const float* histogram, float* angles) {
  float highest = 0;
  for (int k = 0; k < kOrientationBins; ++k) highest = Max(highest, histogram[k]);
  int count = 0;
  for (int k = 0; k < kOrientationBins && count < kMaxOrientations; ++k) {
    const float here = histogram[k];
    const float before = histogram[(k + kOrientationBins - 1) % kOrientationBins];
    const float after = histogram[(k + 1) % kOrientationBins];
    if (!(here > 0.8f * highest && here > before && here > after)) continue;
    const float offset = -0.5f * (after - before) / (after + before - 2 * here);
    float angle = 2 * kPi / kOrientationBins * (static_cast<float>(k) + offset + 0.5f);
    if (angle < 0) angle += 2 * kPi;
    angles[count++] = angle < 2 * kPi ? angle : angle - 2 * kPi;
  }
  if (count == 2 && angles[1] < angles[0]) {
    const float first = angles[1];
    angles[1] = angles[0];
    angles[0] = first;
  }
  return count;
}

// Index of a bin of the descriptor as COLMAP stores it: directions are reversed, those of Lowe's
// program.
PEPESEG_HD int DescriptorIndex(int cell_y, int cell_x, int bin) {
  return (cell_y * kDescriptorCells + cell_x) * kDescriptorBins +
         (kDescriptorBins - bin) % kDescriptorBins;
}

// Returns the byte of a value of a descriptor whose clamped values sum to `sum` (RootSIFT,
// Arandjelovic and Zisserman 2012).
PEPESEG_HD uint8_t RootSiftByte(float value, float sum) {
  if (!(sum > 0)) return 0;
  return static_cast<uint8_t>(Min(255.0f, 512 * Sqrt(value / sum) + 0.5f));
}

}  // namespace pepeseg
