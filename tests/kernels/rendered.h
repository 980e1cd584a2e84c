#pragma once

#include <vector>

#include "kernels/backend.h"
#include "tests/kernels/test_scene.h"

namespace pepeseg {

// A scene in the memory of a backend, with everything that a step of training needs. Members from
// `view` to `dropout` may be changed before Render, see RenderArgs.
struct Rendered {
  Rendered(Backend& backend, const HostGaussians& scene, const PinholeView& view);

  void Render();
  // Runs RenderBackward with these gradients of colour, alpha and depth; the last two may be empty.
  void Backward(const std::vector<float>& color_grad, const std::vector<float>& alpha_grad = {},
                const std::vector<float>& depth_grad = {});
  // Returns the gradients of the parameters after Backward, [planes, count]: 0 for Gaussians that
  // are not visible or have one that is not finite. Changes nothing but the scratch's counters.
  std::vector<float> ParameterGradient();
  // Arguments for Backend::Update, which the caller may adjust.
  UpdateArgs MakeUpdateArgs();
  int64_t Counter(RenderCounter counter) const;

  Backend& backend;
  HostGaussians host;
  PinholeView view;
  float near_plane = 0.05f;
  bool inverse_depth = false;
  bool for_backward = true;
  int64_t tile_entry_capacity = 0;
  Dropout dropout;
  Buffer<float> gaussians, moment1, moment2;
  Buffer<int32_t> num_steps;
  Buffer<float> color, alpha, depth;
  RenderScratch scratch;
  UpdateStep step;  // of the last MakeUpdateArgs, which refers to it
};

}  // namespace pepeseg
