#include "tests/kernels/test_scene.h"

#include <cmath>
#include <random>

namespace pepeseg {

HostGaussians RandomScene(const RandomSceneOptions& options) {
  HostGaussians scene{options.count, options.sh_degree, {}};
  scene.planes.resize(options.count * NumPlanes(options.sh_degree));
  std::mt19937_64 engine(options.seed);
  const auto uniform = [&](float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(engine);
  };
  // Means fill a box in front of the camera; quaternions are not normalised.
  for (int64_t i = 0; i < options.count; ++i) {
    scene.At(kMeanPlane, i) = uniform(-1.3f, 1.3f);
    scene.At(kMeanPlane + 1, i) = uniform(-1.0f, 1.0f);
    scene.At(kMeanPlane + 2, i) = uniform(-0.8f, 1.5f);
    for (int k = 0; k < 3; ++k) {
      scene.At(kLogScalePlane + k, i) =
          uniform(std::log(options.min_scale), std::log(options.max_scale));
    }
    for (int k = 0; k < 4; ++k) scene.At(kRotationPlane + k, i) = uniform(-1, 1);
    scene.At(kOpacityPlane, i) = uniform(options.min_opacity_logit, options.max_opacity_logit);
    for (int k = 0; k < 3 * NumShCoefficients(options.sh_degree); ++k) {
      scene.At(kShPlane + k, i) = k < 3 ? uniform(-1.5f, 1.5f) : uniform(-0.4f, 0.4f);
    }
  }
  return scene;
}

PinholeView TestView(int width, int height) {
  PinholeView view;
  view.width = width;
  view.height = height;
  view.fx = 0.9f * width;
  view.fy = 0.95f * width;
  view.cx = 0.52f * width;
  view.cy = 0.47f * height;
  const float angle = 0.1f, c = std::cos(angle), s = std::sin(angle);
  const float cam_from_world[12] = {c, 0, s, 0.05f, 0, 1, 0, -0.02f, -s, 0, c, 2.2f};
  std::copy(std::begin(cam_from_world), std::end(cam_from_world), view.cam_from_world);
  return view;
}

std::vector<float> RandomValues(int64_t count, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<float> values(count);
  for (float& value : values) value = uniform(engine);
  return values;
}

GaussianPlanes PlanesIn(Buffer<float>& buffer, const HostGaussians& gaussians) {
  return {buffer.span().data, gaussians.count, gaussians.count, gaussians.sh_degree};
}

Buffer<float> Upload(Backend& backend, const std::vector<float>& values) {
  return Buffer<float>(backend, std::span<const float>(values));
}

}  // namespace pepeseg
