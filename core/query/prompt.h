#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "core/scene/mask_set.h"
#include "core/scene/model.h"

namespace pepeseg {

// Limits of a view and of a prompt, which the checks below enforce.
inline constexpr int kMaxViewSide = 16'384;
inline constexpr int64_t kMaxViewPixels = 64'000'000;
inline constexpr size_t kMaxPromptPoints = 256;

struct PointPrompt {
  double x = 0, y = 0;  // pixels of the prompt's view, in [0, width) x [0, height)
  bool positive = true;
};

// Stands for the thing that fills the box.
struct BoxPrompt {
  double x = 0, y = 0, width = 0, height = 0;  // pixels of the prompt's view
};

// Points, a box or a mask in a view, which stand for a thing to segment.
struct Prompt {
  ModelView view;
  // Limits: at least one positive point, at most kMaxPromptPoints; a box that overlaps the view; a
  // mask of the view's size with at least one pixel.
  std::variant<std::vector<PointPrompt>, BoxPrompt, BinaryMask> what;
};

// The size of the thing that is meant, and how similar its pixels are. Absent values are chosen.
struct Granularity {
  std::optional<double> scale = {};      // quantile, [0, 1]
  std::optional<double> threshold = {};  // cosine, [-1, 1]
};

// A query that gives a mask in any view. A pixel is inside if its best similarity to a positive
// feature exceeds the threshold and its best similarity to a negative feature.
struct Query {
  std::vector<float> features;    // [num, 32] as rendered, not gated
  std::vector<uint8_t> positive;  // [num] 0 or 1, at least one of them 1
  double scale = 0.5;             // quantile, [0, 1]
  double threshold = 0.75;        // cosine, [-1, 1]
};

// Each returns INVALID_ARGUMENT, which names the field, its value and its limits, unless the
// argument is valid.
absl::Status CheckView(const ModelView& view);
absl::Status CheckScale(double scale);
absl::Status CheckThreshold(double threshold);
absl::Status CheckPoints(const ModelView& view, std::span<const PointPrompt> points);
absl::Status CheckBox(const ModelView& view, const BoxPrompt& box);
absl::Status CheckMask(const ModelView& view, const BinaryMask& mask);
absl::Status CheckQuery(const Query& query);

// Returns INVALID_ARGUMENT for a valid prompt where the model shows no Gaussian with a feature, as
// in the background or where no mask covered anything in training. IsNothingThere distinguishes it
// from other errors by a payload of the status.
absl::Status NothingThereError(absl::string_view message);
bool IsNothingThere(const absl::Status& status);

}  // namespace pepeseg
