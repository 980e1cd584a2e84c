#pragma once

#include "core/query/prompt.h"
#include "core/query/view_features.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// The thing that a prompt means, in the view of the prompt.
struct PromptMeaning {
  // [height, width]; without pixels: that of the query.
  BinaryMask mask;
  // The query of the model that is nearest to the thing. No features: it is not known.
  Query query;
  // Whether the query gives the mask in the view, and so the thing in any other one. Else clicks
  // changed only a part of what it gives, or an image segmenter saw the mask.
  bool is_of_query = false;
  // The mask that the query gives in the view, if clicks changed a part of it; else no pixels.
  BinaryMask unchanged = {};
  // In which the segmenter saw the mask; kNone: the model alone gave it.
  BorderImage image = BorderImage::kNone;
};

}  // namespace pepeseg
