#pragma once

#include "core/scene/model.h"

namespace pepeseg::testing {

// Two opaque blobs, left and right, before the camera of a view "front" of size x size pixels;
// nothing else. Their features are zeros, to be filled in.
Model FrontBlobs(int size);

// The same with features: two things at small scales, one thing at large ones.
Model PairOfBlobs(int size);

}  // namespace pepeseg::testing
