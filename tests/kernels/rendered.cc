#include "tests/kernels/rendered.h"

#include <algorithm>

namespace pepeseg {

Rendered::Rendered(Backend& backend_in, const HostGaussians& scene, const PinholeView& view_in)
    : backend(backend_in),
      host(scene),
      view(view_in),
      gaussians(Upload(backend, scene.planes)),
      moment1(backend, static_cast<int64_t>(scene.planes.size())),
      moment2(backend, static_cast<int64_t>(scene.planes.size())),
      num_steps(backend, scene.count),
      color(backend, int64_t{3} * view.width * view.height),
      alpha(backend, int64_t{view.width} * view.height),
      depth(backend, int64_t{view.width} * view.height) {}

void Rendered::Render() {
  RenderArgs args;
  args.gaussians = PlanesIn(gaussians, host);
  args.view = view;
  args.near_plane = near_plane;
  args.active_sh_degree = host.sh_degree;
  args.dropout = dropout;
  args.tile_entry_capacity = tile_entry_capacity;
  args.scratch = &scratch;
  args.color = color.span();
  args.alpha = alpha.span();
  args.depth = depth.span();
  args.inverse_depth = inverse_depth;
  args.for_backward = for_backward;
  backend.Render(args);
}

void Rendered::Backward(const std::vector<float>& color_grad, const std::vector<float>& alpha_grad,
                        const std::vector<float>& depth_grad) {
  const Buffer<float> color_in = Upload(backend, color_grad);
  const Buffer<float> alpha_in = Upload(backend, alpha_grad);
  const Buffer<float> depth_in = Upload(backend, depth_grad);
  RenderBackwardArgs args;
  args.view = view;
  args.color_grad = color_in.span();
  args.alpha_grad = alpha_in.span();
  args.depth_grad = depth_in.span();
  args.scratch = &scratch;
  backend.RenderBackward(args);
}

// Without decay, the first moment after a step is the gradient.
std::vector<float> Rendered::ParameterGradient() {
  Buffer<float> planes = Upload(backend, Download(gaussians));
  Buffer<float> grad(backend, gaussians.size()), squares(backend, gaussians.size());
  Buffer<int32_t> steps(backend, num_steps.size());
  UpdateArgs args = MakeUpdateArgs();
  args.learning_rates = {};
  args.beta1 = 0;
  args.gaussians = PlanesIn(planes, host);
  args.moment1 = PlanesIn(grad, host);
  args.moment2 = PlanesIn(squares, host);
  args.num_steps = steps.span();
  backend.Update(args);
  return Download(grad);
}

UpdateArgs Rendered::MakeUpdateArgs() {
  UpdateArgs args;
  step = {.view = view, .dropout = dropout, .scratch = &scratch};
  args.steps = {&step, 1};
  args.active_sh_degree = host.sh_degree;
  args.learning_rates = {1e-3f, 5e-3f, 1e-3f, 5e-2f, 2.5e-3f, 1.25e-4f};
  args.gaussians = PlanesIn(gaussians, host);
  args.moment1 = PlanesIn(moment1, host);
  args.moment2 = PlanesIn(moment2, host);
  args.num_steps = num_steps.span();
  return args;
}

int64_t Rendered::Counter(RenderCounter counter) const {
  return Download(scratch.counters)[counter];
}

}  // namespace pepeseg
