#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/query/mask_geometry.h"

// How people click, as numbers that rank masks (METHOD.md section 4, "Points"). Masks are [height,
// width] of 0 and 1. Exponents were learnt on seven scenes: tests/bench/results/click_ranks.md.

namespace pepeseg {

// A click on a pixel of a view.
struct PixelClick {
  PixelIndex pixel;
  bool positive = true;
};
// Returns how many clicks a mask with `width` columns answers.
int64_t NumAnswered(std::span<const PixelClick> clicks, std::span<const uint8_t> mask, int width);

// Returns how plausible it is, in [0, 1], that a person who clicks on a pixel means this mask:
// people click into the middle of things. It is the depth of the pixel in the mask, divided by the
// greatest depth there, to the power of 1.5. 0: the mask does not have the pixel.
double FirstClickPlausibility(const PixelIndex& pixel, std::span<const uint8_t> mask, int width);

// Returns how plausible it is, in [0, 1], that a person who sees the mask `before` and makes the
// last of the clicks wants the mask `after`. A person clicks into the middle of what is wrong and
// means to keep the rest. The value is the product of
// - the depth of the pixel in what changes (added by a positive click, removed by a negative one),
//   divided by the greatest depth there,
// - the cube root of the share of `before` that a positive click keeps, or of the share of `after`
//   that was in `before` for a negative click,
// - the cube root of the share of all changed pixels that are connected with the click,
// - 0.7 for each click that `after` does not answer.
// 0: `after` does not change the pixel as the click asks.
double ClickPlausibility(std::span<const PixelClick> clicks, std::span<const uint8_t> before,
                         std::span<const uint8_t> after, int width);

// How much of a change a click means.
enum class ChangeReach {
  kWhole,      // all of it
  kConnected,  // what the click asks for and is connected with it, by edges of pixels
  kNear,       // of that, what is at most 1.5 times as far from the click as the nearest pixel that
               // does not change
};
// Returns `before`, changed to `after` as far as the click reaches. Empty: `after` does not change
// the pixel as the click asks.
std::vector<uint8_t> ChangeMask(const PixelClick& click, std::span<const uint8_t> before,
                                std::span<const uint8_t> after, int width, ChangeReach reach);

}  // namespace pepeseg
