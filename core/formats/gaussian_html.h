#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/formats/gaussian_spz.h"
#include "core/scene/camera.h"
#include "core/scene/model.h"

namespace pepeseg {

// Greatest number of Gaussians of a page, which a browser still opens: 110 MB.
inline constexpr int64_t kMaxHtmlGaussians = 5'000'000;

// What a page has besides the Gaussians.
struct SplatPage {
  std::string title;  // UTF-8; any text
  // The view that it shows first.
  Camera camera;
  Pose cam_from_world;
  Eigen::Vector3d up = {0, -1, 0};  // in the world; the view is turned around it
  double near = 0.01;               // distance of the near plane, scene units
};

// Returns the page of a model: it shows the model's first view first, and turns around the
// direction that is up in the mean of all views. Without views it looks at the model from the
// front.
SplatPage SplatPageOf(const Model& model, std::string title);

// Gaussians as a page of HTML (splat_page.html) that shows them, from a file and without a network:
// a viewer in JavaScript for WebGL 2, and an SPZ of SH degree 0 as base64, about 23 bytes for each
// Gaussian. A block of the SPZ is a line, so that its base64 can be decoded by itself.
class GaussianHtmlBlocks final : public GaussianSpzBlocks {
 public:
  // See GaussianBlocks.
  GaussianHtmlBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                     const SplatPage& page);

  int64_t num_blocks() const override { return GaussianSpzBlocks::num_blocks() + 2; }
  std::string Encode(int64_t block) const override;

 private:
  std::string start_, end_;  // what is before and after the Gaussians
};

}  // namespace pepeseg
