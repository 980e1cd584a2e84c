#pragma once

#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Returns how sharp a view's photograph is: the logarithm of the mean squared gradient at full size
// over that at half size. Blur takes the finest detail first, whatever the photograph shows. About
// 200 rows are looked at, without ignored pixels. NaN: the photograph has fewer than 10,000 pixels,
// or no gradient.
double Sharpness(const View& view);

// Returns, for each training view in their order, whether its photograph is blurred: less sharp by
// kBlurred than the median of the training views nearest to it, which show much the same. Captures
// with fewer than 8 training views have none.
std::vector<bool> FindBlurred(const Capture& capture);

// Sharpness below the median from which on a photograph is blurred. Measured on seven scenes
// (tests/bench/results/blur.md): sharp photographs are at most 0.13 below the median, those with a
// motion of 3 pixels at least 0.17.
inline constexpr double kBlurred = 0.2;

}  // namespace pepeseg
