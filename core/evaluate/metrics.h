#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "core/scene/model.h"
#include "kernels/backend.h"

namespace pepeseg {

struct ViewScores {
  std::string view;
  ImageScores scores;
};

// Of a photograph and a rendering [height, width, 3] in [0, 1]; nothing: it cannot be measured.
using PerceptualDistance =
    std::function<std::optional<double>(const Image& photo, std::span<const float> rendering)>;

// Renders every held-out view and scores it against its photograph, in the capture's order.
// `lpips`, where there is one, sees the photograph's own pixels in place of ignored ones.
absl::StatusOr<std::vector<ViewScores>> ScoreHeldOut(Backend& backend, const Capture& capture,
                                                     const Gaussians& gaussians,
                                                     const PerceptualDistance& lpips = nullptr);
// Its LPIPS is over the views that have one.
ImageScores Mean(std::span<const ViewScores> scores);

// |P and G| / |P or G|; both empty: 1. Masks of equal size; pixels with a non-zero `ignore` are
// left out (empty: none).
double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore = {});

}  // namespace pepeseg
