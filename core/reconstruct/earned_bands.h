#pragma once

#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/training_views.h"

namespace pepeseg {

// The smallest degree of the spherical harmonics at which the training views, every few of them,
// are rendered to within `min_gain` dB of what all degrees of the state give. Waits for the
// backend, of which nothing may be under way.
int EarnedShDegree(Backend& backend, const TrainingViews& views, float near_plane,
                   GaussianState& state, double min_gain);

}  // namespace pepeseg
