#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/scene/camera.h"
#include "core/scene/gaussians.h"
#include "core/scene/photograph.h"

namespace pepeseg {

// Quality of rendered views against their photographs: of one view, or the mean over several.
// Pixels under the ignore mask are left out.
struct ImageScores {
  double psnr = 0;                             // dB, peak 1
  double ssim = 0;                             // 11x11 Gaussian window, sigma 1.5
  std::optional<double> lpips = std::nullopt;  // absent without the network's weights
};

// The result of stage two: a feature for each Gaussian, the scale gate, and the distribution of the
// scales of masks.
struct FeatureField {
  std::vector<float> features;  // [num_gaussians, 32], each of length 1
  // [num_gaussians], in (0, 1]: weight of a feature in blending, see GaussianCoverage. Empty: 1 for
  // all.
  std::vector<float> confidence;
  // The scale gate psi(s), of one or two layers: kGateSize or kTwoLayerGateSize numbers, see
  // kernels/math/gate.h.
  std::vector<float> gate = std::vector<float>(64);
  std::vector<float> scale_quantiles;  // [1000] ascending, scene units: quantile k / 999

  bool empty() const { return features.empty(); }
};

// A training or held-out view, or a free camera.
struct ModelView {
  std::string name;
  Camera camera;
  Pose cam_from_world;
  bool held_out = false;
  std::optional<ImageScores> scores = std::nullopt;  // absent for training views
  // The uploaded photograph behind the view. Absent for a free camera and for models trained before
  // it was recorded.
  std::optional<Photograph> photograph = std::nullopt;
};

// How a photograph is turned and shrunk, see FormPhotograph.
struct PhotographForm {
  // The view that the photograph is warped to; it says whether it is of the stored or of the
  // upright pixels. Absent: it is not warped, but turned upright if `upright`.
  std::optional<ModelView> view = std::nullopt;
  bool upright = false;
  int max_side = 0;  // longer side of the result, pixels; larger images are shrunk to it. 0: none
};

// A trained model. It holds everything that a query needs; the photographs are not needed.
struct Model {
  Gaussians gaussians;
  FeatureField field;
  std::vector<ModelView> views;
  // Origin of the coordinates of Gaussians and poses, in the world of the dataset; see OriginOf.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double scene_radius = 1;                // see SceneRadius; the near plane is at 0.01 of it
  std::map<std::string, double> metrics;  // "psnr", "ssim" (held out), "seconds_reconstruct", ...
  std::map<std::string, std::string> facts;  // options in effect, seed, versions, device
};

// The numbers that determine the size of a model in memory.
struct ModelShape {
  int64_t num_gaussians = 0;
  int sh_degree = 0;
  int64_t max_view_pixels = 0;  // of the largest view; 0: no views
};

// Returns the number of pixels of the largest view, or 0 if there are no views.
int64_t LargestView(const std::vector<ModelView>& views);

// Converts a length in scene units to the quantile, in [0, 1], that it has among the scales of
// `field`, and back. Interpolates linearly between quantiles and clamps beyond them; returns 0 if
// the field has no scales.
double QuantileOfScale(const FeatureField& field, double scene_units);
double ScaleOfQuantile(const FeatureField& field, double quantile);

// Writes psi(scale), [32], of a FeatureField::gate. `scale` is a quantile scale.
void PsiAt(std::span<const float> gate, float scale, float* psi);
// Returns the features [n, 32], each gated by psi(scale) and scaled to length 1. `features` is
// [n, 32]; `gate` is FeatureField::gate; `scale` is a quantile scale.
std::vector<float> GatedUnits(std::span<const float> features, std::span<const float> gate,
                              float scale);

// Returns the feature, [32] and not gated, whose gated direction is that of the mean of
// GatedUnits(features, gate, scale): a query for the mean of several features. It is 0 if the mean
// is 0 or there are no features.
std::vector<float> GatedMean(std::span<const float> features, std::span<const float> gate,
                             float scale);

}  // namespace pepeseg
