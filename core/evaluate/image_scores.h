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

// Returns the perceptual distance between a photograph and its rendering, [height, width, 3] in
// [0, 1], or nothing if it cannot be measured.
using PerceptualDistance =
    std::function<std::optional<double>(const Image& photo, std::span<const float> rendering)>;

// Renders every held-out view and returns its PSNR, SSIM and, if `lpips` is set, LPIPS against the
// photograph, in the capture's order. Ignored pixels are not scored; `lpips` gets the photograph's
// values there. FAILED_PRECONDITION names a view whose photograph or ignore mask does not have the
// camera's size, or whose ignore mask covers every pixel. INTERNAL: the device failed.
absl::StatusOr<std::vector<ViewScores>> ScoreHeldOut(Backend& backend, const Capture& capture,
                                                     const Gaussians& gaussians,
                                                     const PerceptualDistance& lpips = nullptr);
// Returns the mean of each score, all 0 for no views. The mean LPIPS covers the views that have
// one.
ImageScores Mean(std::span<const ViewScores> scores);

// Stores the scores with the model's views of the same names.
void RecordScores(std::span<const ViewScores> scores, Model& model);

}  // namespace pepeseg
