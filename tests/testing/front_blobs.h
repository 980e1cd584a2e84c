#pragma once

#include "core/scene/model.h"

namespace pepeseg::testing {

// Returns a model of two opaque blobs, left and right, in front of the camera of its only view,
// "front", of size x size pixels. Their features are zeros, for the caller to set.
Model FrontBlobs(int size);

// Returns the same model with features: the blobs are two objects at small scales, one at large
// ones.
Model PairOfBlobs(int size);

}  // namespace pepeseg::testing
