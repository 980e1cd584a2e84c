#pragma once

#include <vector>

#include "kernels/backend.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {

// A scene in a backend's memory with everything that a step of training needs.
struct Rendered {
  Rendered(Backend& backend, const HostGaussians& scene, const PinholeView& view);

  void Render();
  // Gradients of `color`, and of alpha and depth where not empty.
  void Backward(const std::vector<float>& color_grad, const std::vector<float>& alpha_grad = {},
                const std::vector<float>& depth_grad = {});
  std::vector<float> ParameterGradient();  // [planes, count], of the last Backward
  UpdateArgs MakeUpdateArgs();             // to be adjusted and given to Backend::Update
  int64_t Counter(RenderCounter counter) const;

  Backend& backend;
  HostGaussians host;
  PinholeView view;
  float background[3] = {0.1f, 0.3f, 0.2f};
  float near_plane = 0.05f;
  bool inverse_depth = false;  // likewise
  bool for_backward = true;    // likewise
  int64_t entry_room = 0;      // see RenderArgs
  Buffer<float> gaussians, moment1, moment2;
  Buffer<int32_t> num_steps;
  Buffer<float> color, alpha, depth;
  RenderScratch scratch;
};

}  // namespace pepeseg
