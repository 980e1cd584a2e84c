#pragma once

#include <array>

#include "tests/kernels/refined.h"

namespace pepeseg {

// The refinement of one Gaussian, computed in double by the simplest means: the Jacobian by
// differences, a walk along the axis in steps of 0.01 pixels, and masks as images.
struct ReferenceRefinement {
  bool refined = false;
  double share = 0;                // of the axis inside the mask
  int axis = 0;                    // the axis in space that is cut
  std::array<double, 3> to_end{};  // from the mean to the end inside the mask
  // A small change of the Gaussian changes a decision, so single precision may decide otherwise.
  bool close_call = false;
};
ReferenceRefinement RefineReference(const HostGaussians& scene, int64_t i, const PinholeView& view,
                                    const MaskImages& masks);

}  // namespace pepeseg
