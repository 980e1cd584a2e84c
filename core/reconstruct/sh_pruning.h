#pragma once

#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/training_views.h"

namespace pepeseg {

// SH degree pruning (METHOD.md section 1, "What a scene does not need"). Returns the smallest
// degree of the spherical harmonics at which the training views (16 of them at most, evenly spaced)
// are rendered to within `min_gain` dB of the PSNR with all degrees. Returns the state's degree
// when the backend is out of memory. Waits for the backend, on which no step may be queued.
int SufficientShDegree(Backend& backend, const TrainingViews& views, float near_plane,
                       GaussianState& state, double min_gain);

}  // namespace pepeseg
