#pragma once

#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "core/scene/mask_set.h"
#include "core/scene/model.h"

namespace pepeseg {

struct PointPrompt {
  double x = 0, y = 0;  // pixels of the prompt's view, in [0, width) x [0, height)
  bool positive = true;
};

// The thing that fills the box: what is mostly inside it.
struct BoxPrompt {
  double x = 0, y = 0, width = 0, height = 0;  // pixels of the prompt's view
};

// What somebody points at.
struct Prompt {
  ModelView view;
  // At least one positive point; a box that overlaps the view; a mask of the view's size with at
  // least one pixel.
  std::variant<std::vector<PointPrompt>, BoxPrompt, BinaryMask> what;
};

// How large a thing is meant, and how alike its pixels are; what is absent is chosen.
struct Granularity {
  std::optional<double> scale = {};      // quantile, [0, 1]
  std::optional<double> threshold = {};  // cosine, [-1, 1]
};

// What is looked for in any view: a pixel is in when its best similarity to a positive feature is
// over the threshold and over its best similarity to a negative one.
struct Query {
  std::vector<float> features;    // [num, 32] as rendered, not gated
  std::vector<uint8_t> positive;  // [num] 0 or 1, at least one of them 1
  double scale = 0.5;             // quantile, [0, 1]
  double threshold = 0.75;        // cosine, [-1, 1]
};

}  // namespace pepeseg
