#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "core/render/renderer.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// All that a view shows of a thing. The mask has the size of the view.
struct Correction {
  ModelView view;
  BinaryMask mask;
};

// The pixels of a corrected view in terms of Gaussians. The view is shrunk by the smallest whole
// factor that leaves at most kMaxCorrectedPixels.
inline constexpr int64_t kMaxCorrectedPixels = 49'152;
struct CorrectedPixels {
  PixelRows rows;
  std::vector<uint8_t> inside;  // [pixels] 0 or 1: of the mask
  // [pixels] 0 or 1: a feature is rendered, so that a query can find the pixel (kMinPixelNorm).
  std::vector<uint8_t> solid;
  std::vector<float> features;  // [pixels, 32] as blended, not gated

  size_t num_pixels() const { return inside.size(); }
};

// Captures the pixels of a view, in one short use of the device. Errors are those of
// Segmenter::Rows.
absl::StatusOr<CorrectedPixels> CapturePixels(const Segmenter& segmenter,
                                              const Correction& correction);

// Blends other features, [num_gaussians, 32], over the pixels: sets `features` and `solid`.
void BlendFeatures(const FeatureField& field, CorrectedPixels& pixels);

// How well the query of a direction finds the masks at a scale.
struct ScaleFit {
  double scale = 0;              // quantile
  std::vector<float> gate;       // [32] psi(scale)
  std::vector<float> direction;  // [32] gated, of length 1: the mean of the pixels inside
  double threshold = 0;          // the middle of those with the best IoU over all views
  double iou = 0;                // over all views together
  std::vector<double> iou_of_view;
};
// Returns the fit of the mean direction of the pixels inside, at a scale. At least one pixel inside
// must be solid.
ScaleFit FitScale(const FeatureField& field, std::span<const CorrectedPixels> views, double scale);

}  // namespace pepeseg
