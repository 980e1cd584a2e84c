#pragma once

#include <cstdint>
#include <vector>

#include "kernels/backend.h"
#include "tests/kernels/rendered.h"

namespace pepeseg {

// Masks of a view as plain images [H, W] of 0 and 1.
using MaskImages = std::vector<std::vector<uint8_t>>;

// Returns the mask of the pixels for which inside(x, y) holds.
template <class Inside>
std::vector<uint8_t> MaskWhere(const PinholeView& view, Inside inside) {
  std::vector<uint8_t> mask;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) mask.push_back(inside(x, y) ? 1 : 0);
  }
  return mask;
}

// A rendered scene with the masks of its view and everything that a refinement needs. Moments and
// step counts start at 7, and all Gaussians are refinable.
struct Refined {
  Refined(Backend& backend, const HostGaussians& scene, const PinholeView& view,
          const MaskImages& masks);

  // Arguments for Backend::RefineGaussians, which the caller may adjust. All ranked are candidates.
  RefineGaussiansArgs MakeArgs();
  int64_t Count(RefineCount count) const { return Download(counts)[count]; }
  HostGaussians Result() const;
  bool WasRefined(int64_t i) const { return Download(refinable)[i] == 0; }

  Rendered rendered;
  int words;
  Buffer<uint32_t> pixel_cell;
  Buffer<uint64_t> cell_bits;
  Buffer<int64_t> mask_area;
  Buffer<int32_t> refinable;
  RefineScratch scratch;
  Buffer<int32_t> outside_source;
  Buffer<float> outside_shape;
  Buffer<int64_t> counts;
};

}  // namespace pepeseg
