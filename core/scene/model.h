#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/camera.h"
#include "core/scene/gaussians.h"
#include "core/scene/image_scores.h"
#include "core/scene/photograph.h"

namespace pepeseg {

// The result of stage two: a feature per Gaussian, the scale gate and the scales' distribution.
struct FeatureField {
  std::vector<float> features;         // [num_gaussians, 32], normalised
  std::vector<float> confidence;       // [num_gaussians] (0, 1], see FeatureConfidence; none: all 1
  std::array<float, 64> gate{};        // W[32], b[32]: psi(s) = sigmoid(W s + b)
  std::vector<float> scale_quantiles;  // [1000] ascending, scene units: quantile k / 999

  bool empty() const { return features.empty(); }
};

struct ModelView {
  std::string name;
  Camera camera;
  Pose cam_from_world;
  bool held_out = false;
  std::optional<ImageScores> scores = std::nullopt;  // of a held-out view
  // What it was made of. None: a free camera, or a model that was trained before this was recorded.
  std::optional<Photograph> photograph = std::nullopt;
};

// Everything that a query needs; loading one never needs the photographs.
struct Model {
  Gaussians gaussians;
  FeatureField field;
  std::vector<ModelView> views;
  // Means and poses are relative to it: a place in the world of the dataset, see origin.h.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double scene_radius = 1;                // see SceneRadius; the near plane is 0.01 of it
  std::map<std::string, double> metrics;  // "psnr", "ssim" (held out), "seconds_reconstruct", ...
  std::map<std::string, std::string> facts;  // options in effect, seed, versions, device
};

// Pixels of the largest one; 0: there is none.
int64_t LargestView(const std::vector<ModelView>& views);

// Quantile scale in [0, 1] of a length in scene units, and back (linear between knots).
double QuantileOfScale(const FeatureField& field, double scene_units);
double ScaleOfQuantile(const FeatureField& field, double quantile);

}  // namespace pepeseg
