#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/backend.h"

namespace pepeseg {

// Gaussians on the host in the layout of kernels/gaussian_planes.h, stride == count.
struct HostGaussians {
  int64_t count = 0;
  int sh_degree = 0;
  std::vector<float> planes;

  float& At(int plane, int64_t i) { return planes[plane * count + i]; }
  float At(int plane, int64_t i) const { return planes[plane * count + i]; }
};

struct RandomSceneOptions {
  int64_t count = 100;
  int sh_degree = 3;
  float min_scale = 0.02f, max_scale = 0.2f;  // standard deviations, scene units
  float min_opacity_logit = -2, max_opacity_logit = 3;
  uint64_t seed = 1;
};

// Returns random Gaussians in front of the camera of TestView, some of them beyond the image.
HostGaussians RandomScene(const RandomSceneOptions& options);

// Returns a camera about 2 scene units in front of the origin, slightly turned, with its principal
// point off centre.
PinholeView TestView(int width, int height);

// Returns random numbers in [-1, 1], for instance as the gradient of some loss.
std::vector<float> RandomValues(int64_t count, uint64_t seed);

// The planes of `gaussians` in a buffer of their size.
GaussianPlanes PlanesIn(Buffer<float>& buffer, const HostGaussians& gaussians);
// Copies to and from a backend.
Buffer<float> Upload(Backend& backend, const std::vector<float>& values);
template <class T>
std::vector<T> Download(const Buffer<T>& buffer) {
  std::vector<T> host(buffer.size());
  buffer.Download(std::span<T>(host));
  return host;
}

}  // namespace pepeseg
