#pragma once

#include "core/reconstruct/options.h"
#include "core/reconstruct/pixel_budget.h"

namespace pepeseg {

// Returns the options for these training views. Where there are more than kManyViews, and steps see
// each of them fewer than few_visits times on average, a Gaussian gets few gradients to go by:
// rates are raised, more Gaussians are densified, gradients are averaged over fewer steps, and none
// is left out. The changes grow with the logarithm of few_visits / visits and are whole from a
// third of few_visits on. With raised rates fewer steps suffice: under half of few_visits they are
// reduced, to few_visits_steps of them at the least, where they render more than
// megapixels_per_step and coarse_until is not at its limit. Unchanged where few_visits is 0 or
// views are few. To be applied after WithPixelBudget.
ReconstructOptions WithFewVisits(ReconstructOptions options, const ViewPixels& views);

// Returns the options with both, as stage one uses them.
inline ReconstructOptions FitToViews(const ReconstructOptions& options, const ViewPixels& views) {
  return WithFewVisits(WithPixelBudget(options, views), views);
}

}  // namespace pepeseg
