#pragma once

#include <array>

#include "tests/kernels/refined.h"

namespace pepeseg {

// What the refinement of one Gaussian should be, found in double the plain way: the Jacobian by
// differences, the axis walked in hundredths of a pixel, masks looked up as images.
struct ReferenceRefinement {
  bool refined = false;
  double share = 0;                // of the axis inside the mask
  int axis = 0;                    // in space
  std::array<double, 3> to_end{};  // from the mean to the end inside the mask
  // A small change of the Gaussian turns a decision: single precision may decide the other way.
  bool close_call = false;
};
ReferenceRefinement RefineReference(const HostGaussians& scene, int64_t i, const PinholeView& view,
                                    const MaskImages& masks);

}  // namespace pepeseg
