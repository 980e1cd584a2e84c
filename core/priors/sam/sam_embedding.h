#pragma once

#include <vector>

#include "kernels/half.h"

namespace pepeseg {

// What SAM's decoder needs of an image: the answer of the encoder, rounded to Halves. 2 MB.
struct SamEmbedding {
  int width = 0, height = 0;  // of the image that prompts and masks refer to, pixels
  std::vector<Half> values;   // [places, channels], places in reading order
};

}  // namespace pepeseg
