#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"
#include "core/scene/gaussians.h"
#include "kernels/backend.h"

namespace pepeseg {

// Of a view or a mean over views; pixels under the ignore mask are left out.
struct ImageScores {
  double psnr = 0;  // dB, peak 1
  double ssim = 0;  // 11x11 Gaussian window, sigma 1.5
};

struct ViewScores {
  std::string view;
  ImageScores scores;
};

// Renders every held-out view and scores it against its photograph, in the capture's order.
absl::StatusOr<std::vector<ViewScores>> ScoreHeldOut(Backend& backend, const Capture& capture,
                                                     const Gaussians& gaussians);
ImageScores Mean(std::span<const ViewScores> scores);

// |P and G| / |P or G|; both empty: 1. Masks of equal size; pixels with a non-zero `ignore` are
// left out (empty: none).
double Iou(std::span<const uint8_t> prediction, std::span<const uint8_t> truth,
           std::span<const uint8_t> ignore = {});

}  // namespace pepeseg
