#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

// Measures each Gaussian in the training views: the share of it that lies under masks, and the
// number of views that see it. Both come from sums of its blend weights over the pixels of each
// view (core/render/weight_sums.h).

namespace pepeseg {

// Pixels of a view that none of its masks covers, y * width + x. A mask may be missing in one view,
// so an uncovered pixel alone does not prove background: what counts is how often masks of all
// views cover the Gaussians that it shows.
struct UncoveredPixels {
  std::vector<int32_t> background;         // masks cover less than 10 % of what they show
  std::vector<int32_t> covered_elsewhere;  // the other uncovered pixels
};

struct CoverageOptions {
  int min_confident_views = 0;  // see GaussianCoverage::confidence; 0: it is left empty
  bool find_uncovered = false;  // false: GaussianCoverage::uncovered is left empty
};

struct GaussianCoverage {
  // The confidence of each Gaussian's feature, [num_gaussians] in [0.005, 1] (METHOD.md section 3,
  // "Confidence"; not in the paper). It suppresses floaters: a Gaussian that only one or two
  // cameras see has a feature that fits those views alone, and occludes the scene in all others.
  //
  // Up to 64 of the training views with masks are looked at, spread evenly. The confidence is
  // (views that show the Gaussian / required views)^2, at most 1, where `min_confident_views` views
  // are required, but at least a sixth of the views looked at, and at most all of them.
  std::vector<float> confidence;
  // The uncovered pixels by view of the capture, on a grid of up to about 16,384 pixels of each
  // view (METHOD.md section 3, "Samples"). Ignored pixels and pixels with an alpha of at most 0.5
  // are left out, as are held-out views and views without masks.
  std::vector<UncoveredPixels> uncovered;
};

// Renders each view that stage two learns from once for both results, and those with uncovered
// pixels a second time. masks: the masks that each view learns from, by view of the capture.
GaussianCoverage MeasureCoverage(Backend& backend, const Capture& capture,
                                 std::span<const MaskSet* const> masks, const Gaussians& gaussians,
                                 const CoverageOptions& options);

}  // namespace pepeseg
