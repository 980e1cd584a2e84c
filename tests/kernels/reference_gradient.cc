#include "tests/kernels/reference_gradient.h"

#include <algorithm>
#include <numeric>

#include "kernels/math/blend.h"
#include "kernels/math/projection.h"
#include "kernels/math/sh.h"

// The backward chain of the pipeline in double: the Vjp functions of kernels/math without tiles,
// slots or sums in parts.

namespace pepeseg {
namespace {

// A projected Gaussian and its gradients.
struct DoubleSplat {
  int64_t gaussian;
  Projection<double> p;
  PowerRoot<double> root;
  double opacity;
  double depth;  // z or 1 / z, whichever is blended
  double rgb[3], weighted_sum[3];
  PowerMoments<double> moments;
  double rgb_grad[3], depth_grad;
};

GaussianShape<double> ShapeOf(const ReferenceScene& scene, int64_t i) {
  const auto at = [&](int plane) { return scene.planes[plane * scene.count + i]; };
  return {{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8), at(9)}};
}

// Projects Gaussian i and evaluates its colour.
DoubleSplat MakeSplat(const ReferenceScene& scene, const ProjectionCamera<double>& camera,
                      int64_t i) {
  const GaussianShape<double> shape = ShapeOf(scene, i);
  DoubleSplat out = {};
  out.gaussian = i;
  out.p = Project(camera, shape);
  out.root = MakePowerRoot(out.p.conic.xx, out.p.conic.xy, out.p.determinant);
  out.opacity = Sigmoid(scene.planes[kOpacityPlane * scene.count + i]);
  double basis[16];
  ShBasis(Normalize(shape.mean - CameraCenter(camera)), scene.sh_degree, basis);
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < NumShCoefficients(scene.sh_degree); ++k) {
      out.weighted_sum[c] += basis[k] * scene.planes[(kShPlane + 3 * k + c) * scene.count + i];
    }
    out.rgb[c] = ShChannel(out.weighted_sum[c]);
  }
  return out;
}

// A splat at a pixel, with the transmittance before it.
struct Seen {
  DoubleSplat* splat;
  double dx, dy, alpha, transmittance;
};

// Returns the splats that are blended at a pixel, front to back.
std::vector<Seen> BlendPixel(std::vector<DoubleSplat>& splats, double x, double y) {
  std::vector<Seen> blended;
  double transmittance = 1;
  for (DoubleSplat& s : splats) {
    const double dx = x - s.p.x, dy = y - s.p.y;
    const double power = Power(s.root.xx, PowerAtRow(s.root, dy), dx);
    if (power < MinPower(s.opacity)) continue;
    const double alpha = Alpha(s.opacity, Exp2(power));
    if (transmittance * (1 - alpha) < 1e-4) break;
    blended.push_back({&s, dx, dy, alpha, transmittance});
    transmittance *= 1 - alpha;
  }
  return blended;
}

// Adds the gradients of a pixel to its splats. g is that of its colour; `behind` is behind_dot
// behind the last splat (kernels/math/blend.h).
void BackwardPixel(const std::vector<Seen>& blended, const double* g, double depth_grad,
                   double behind) {
  for (auto it = blended.rbegin(); it != blended.rend(); ++it) {
    DoubleSplat& s = *it->splat;
    const double value = s.rgb[0] * g[0] + s.rgb[1] * g[1] + s.rgb[2] * g[2] + s.depth * depth_grad;
    const double power_grad = GaussianVjp(it->alpha, AlphaVjp(it->transmittance, value, behind));
    behind = BehindStep(it->alpha, value, behind);
    const double weight = it->alpha * it->transmittance;
    for (int c = 0; c < 3; ++c) s.rgb_grad[c] += weight * g[c];
    s.depth_grad += weight * depth_grad;
    s.moments.sum += power_grad;
    s.moments.x += power_grad * it->dx;
    s.moments.y += power_grad * it->dy;
    s.moments.xx += power_grad * it->dx * it->dx;
    s.moments.xy += power_grad * it->dx * it->dy;
    s.moments.yy += power_grad * it->dy * it->dy;
  }
}

// Turns the gradients of a splat into those of the parameters of its Gaussian.
void StoreGradient(const ReferenceScene& scene, const ProjectionCamera<double>& camera,
                   const DoubleSplat& s, std::vector<double>& out) {
  const int64_t i = s.gaussian;
  const GaussianShape<double> shape = ShapeOf(scene, i);
  const auto g = SplatShapeVjp(s.root, s.opacity, s.moments);
  auto grad =
      ProjectVjp(camera, shape, {g.x, g.y, {g.conic_xx, g.conic_xy, g.conic_yy}, s.depth_grad});
  const Vec3<double> offset = shape.mean - CameraCenter(camera);
  double basis[16], basis_grad[16] = {};
  ShBasis(Normalize(offset), scene.sh_degree, basis);
  for (int c = 0; c < 3; ++c) {
    const double sum_grad = ShChannelVjp(s.weighted_sum[c], s.rgb_grad[c]);
    for (int k = 0; k < NumShCoefficients(scene.sh_degree); ++k) {
      const int64_t at = (kShPlane + 3 * k + c) * scene.count + i;
      basis_grad[k] += scene.planes[at] * sum_grad;
      out[at] = basis[k] * sum_grad;
    }
  }
  grad.mean =
      grad.mean + NormalizeVjp(offset, ShBasisVjp(Normalize(offset), scene.sh_degree, basis_grad));
  const double values[] = {grad.mean.x,      grad.mean.y,      grad.mean.z,     grad.log_scale.x,
                           grad.log_scale.y, grad.log_scale.z, grad.rotation.w, grad.rotation.x,
                           grad.rotation.y,  grad.rotation.z};
  for (int k = 0; k < kOpacityPlane; ++k) out[k * scene.count + i] = values[k];
  out[kOpacityPlane * scene.count + i] = SigmoidVjp(s.opacity, g.opacity);
}

}  // namespace

double LossOf(const ReferenceImage& image, const ImageGrad& grad) {
  double loss = std::inner_product(image.color.begin(), image.color.end(), grad.color.begin(), 0.0);
  loss = std::inner_product(image.alpha.begin(), image.alpha.end(), grad.alpha.begin(), loss);
  return std::inner_product(image.depth.begin(), image.depth.end(), grad.depth.begin(), loss);
}

std::vector<double> ReferenceGradient(const ReferenceScene& scene, const PinholeView& view,
                                      const ReferenceOptions& options, const ImageGrad& grad) {
  const auto camera = MakeProjectionCamera<double>(view);
  std::vector<DoubleSplat> splats;
  for (int64_t i = 0; i < scene.count; ++i) {
    DoubleSplat splat = MakeSplat(scene, camera, i);
    const double z = splat.p.mean_in_cam.z;
    splat.depth = options.inverse_depth ? InverseDepth(z) : z;
    if (z > options.near_plane) splats.push_back(splat);
  }
  std::stable_sort(splats.begin(), splats.end(), [](const DoubleSplat& a, const DoubleSplat& b) {
    return a.p.mean_in_cam.z < b.p.mean_in_cam.z;
  });
  const int64_t num_pixels = int64_t{view.width} * view.height;
  for (int64_t i = 0; i < num_pixels; ++i) {
    const double g[] = {grad.color[i], grad.color[num_pixels + i], grad.color[2 * num_pixels + i]};
    // Alpha is 1 - transmittance, so its gradient acts as a colour of -1 behind all splats.
    const double behind = -grad.alpha[i];
    const int64_t column = i % view.width, row = i / view.width;
    const double x = static_cast<double>(column) + 0.5, y = static_cast<double>(row) + 0.5;
    BackwardPixel(BlendPixel(splats, x, y), g, grad.depth[i], behind);
  }
  std::vector<double> out(scene.planes.size());
  for (DoubleSplat& splat : splats) {
    if (options.inverse_depth) splat.depth_grad = InverseDepthVjp(splat.depth, splat.depth_grad);
    StoreGradient(scene, camera, splat, out);
  }
  return out;
}

}  // namespace pepeseg
