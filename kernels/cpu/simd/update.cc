#include "kernels/cpu/simd/gaussian_lanes.h"
#include "kernels/cpu/simd/kernels.h"
#include "kernels/math/adam.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kMaxPlanes = NumPlanes(kMaxShDegree);

// SplatGrad as planes, for the lanes of a group.
struct SplatGradLanes {
  alignas(64) float values[10][kLanes];
};

// What a group of Gaussians is worked on with.
struct Group {
  ProjectionCamera<Lanes> camera;
  const Splat* splats;
  const SplatGrad* grads;
  int degree;
  int num_planes;  // of the active degree
};

PEPESEG_HD Lanes Field(const SplatGradLanes& g, int field) { return Lanes::Load(g.values[field]); }

// Transposes the gradients of the group's visible Gaussians; returns their lanes.
PEPESEG_HD uint32_t Transpose(const SplatGrad* grads, const int32_t* visible, int count,
                              SplatGradLanes& out) {
  uint32_t bits = 0;
  for (int i = 0; i < kLanes; ++i) {
    const bool seen = i < count && visible[i] >= 0;
    bits |= static_cast<uint32_t>(seen) << i;
    const SplatGrad g = seen ? grads[visible[i]] : SplatGrad{};
    const float fields[10] = {g.x,       g.y, g.conic_xx, g.conic_xy, g.conic_yy,
                              g.opacity, g.r, g.g,        g.b,        g.depth};
    for (int k = 0; k < 10; ++k) out.values[k][i] = fields[k];
  }
  return bits;
}

// The colour's part: fills the SH planes of `grad` and returns what goes on to the mean.
PEPESEG_HD Vec3<Lanes> ColorVjp(const Group& group, const GaussianGroup& values, Vec3<Lanes> offset,
                                const SplatGradLanes& splat_grad, Lanes* grad) {
  const Vec3<Lanes> dir = Normalize(offset);
  const int num_coefficients = (group.degree + 1) * (group.degree + 1);
  Lanes basis[16], basis_grad[16];
  ShBasis(dir, group.degree, basis);
  for (int k = 0; k < num_coefficients; ++k) basis_grad[k] = Lanes(0.0f);
  for (int c = 0; c < 3; ++c) {
    const Lanes sum = WeightedSum(values, basis, num_coefficients, c);
    const Lanes sum_grad = ShChannelVjp(sum, Field(splat_grad, 6 + c));
    for (int k = 0; k < num_coefficients; ++k) {
      const int plane = kShPlane + 3 * k + c;
      basis_grad[k] = MulAdd(values.At(plane), sum_grad, basis_grad[k]);
      grad[plane] = basis[k] * sum_grad;
    }
  }
  return NormalizeVjp(offset, ShBasisVjp(dir, group.degree, basis_grad));
}

// From the gradients of the splats to those of all planes. Lanes that are not visible hold
// anything. Returns the lanes in which all are finite.
PEPESEG_HD uint32_t ParameterVjp(const Group& group, const GaussianGroup& values,
                                 const SplatGradLanes& s, Lanes* grad) {
  const GaussianShape<Lanes> shape = LoadShape(values);
  const ProjectionGrad<Lanes> projection_grad = {
      Field(s, 0), Field(s, 1), {Field(s, 2), Field(s, 3), Field(s, 4)}, Field(s, 9)};
  GaussianShape<Lanes> g = ProjectVjp(group.camera, shape, projection_grad);
  const Vec3<Lanes> offset = shape.mean - CameraCenter(group.camera);
  g.mean = g.mean + ColorVjp(group, values, offset, s, grad);
  const Lanes shape_grad[] = {g.mean.x,      g.mean.y,      g.mean.z,     g.log_scale.x,
                              g.log_scale.y, g.log_scale.z, g.rotation.w, g.rotation.x,
                              g.rotation.y,  g.rotation.z};
  for (int k = 0; k < kOpacityPlane; ++k) grad[k] = shape_grad[k];
  grad[kOpacityPlane] = SigmoidVjp(Sigmoid(values.At(kOpacityPlane)), Field(s, 5));
  LaneMask usable = IsUsable(grad[0]);
  for (int k = 1; k < group.num_planes; ++k) usable = usable & IsUsable(grad[k]);
  return BitsOf(usable);
}

PEPESEG_HD LaneMask MaskOf(uint32_t bits) {
  const uint8_t bytes[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
  return {hn::LoadMaskBits(FloatTag(), bytes)};
}

PEPESEG_HD float RateOf(const LearningRates& rates, int plane) {
  if (plane < kLogScalePlane) return rates.mean;
  if (plane < kRotationPlane) return rates.log_scale;
  if (plane < kOpacityPlane) return rates.rotation;
  if (plane < kShPlane) return rates.opacity;
  return plane < kShPlane + 3 ? rates.sh_dc : rates.sh_rest;
}

// Counts the steps of the lanes that are updated and looks up their bias corrections.
PEPESEG_HD AdamRates<Lanes> CountSteps(const ParameterJob& job, int32_t* num_steps, int count,
                                       uint32_t updated) {
  float correction1[kLanes] = {}, correction2[kLanes] = {};
  for (int i = 0; i < count; ++i) {
    num_steps[i] += static_cast<int32_t>(updated >> i & 1u);
    const int32_t step = Min(Max(num_steps[i], 1), job.num_corrections - 1);
    correction1[i] = job.correction1[step];
    correction2[i] = job.correction2[step];
  }
  const UpdateArgs& args = *job.update;
  return {Lanes(args.beta1), Lanes(args.beta2), Lanes(args.epsilon), Lanes::Load(correction1),
          Lanes::Load(correction2)};
}

PEPESEG_HD void AdamGroup(const ParameterJob& job, int num_planes, int64_t first, int count,
                          const Lanes* grad, uint32_t updated) {
  const UpdateArgs& args = *job.update;
  const LaneMask mask = MaskOf(updated);
  const AdamRates<Lanes> rates = CountSteps(job, args.num_steps.data + first, count, updated);
  const bool bounded = args.max_log_scale > args.min_log_scale;
  for (int k = 0; k < num_planes; ++k) {
    float* const value_at = args.gaussians.data + k * args.gaussians.stride + first;
    float* const moment1_at = args.moment1.data + k * args.moment1.stride + first;
    float* const moment2_at = args.moment2.data + k * args.moment2.stride + first;
    const Lanes old = LoadSome(value_at, count);
    const Lanes old1 = LoadSome(moment1_at, count), old2 = LoadSome(moment2_at, count);
    Lanes moment1 = old1, moment2 = old2;
    const Lanes rate(RateOf(args.learning_rates, k));
    Lanes value = old + AdamStep(rates, rate, grad[k], moment1, moment2);
    if (bounded && k >= kLogScalePlane && k < kRotationPlane) {
      value = Min(Max(value, Lanes(args.min_log_scale)), Lanes(args.max_log_scale));
    }
    StoreSome(Select(mask, value, old), value_at, count);
    StoreSome(Select(mask, moment1, old1), moment1_at, count);
    StoreSome(Select(mask, moment2, old2), moment2_at, count);
  }
}

PEPESEG_HD void AddStats(const UpdateArgs& args, int64_t gaussian, const Splat& splat,
                         const SplatGrad& grad) {
  const DensityStats& stats = args.stats;
  if (stats.mean2d_grad_sum.size > 0) {
    const float gx = grad.x * 0.5f * static_cast<float>(args.view.width);
    const float gy = grad.y * 0.5f * static_cast<float>(args.view.height);
    stats.mean2d_grad_sum.data[gaussian] += Sqrt(gx * gx + gy * gy);
  }
  if (stats.num_visible.size > 0) ++stats.num_visible.data[gaussian];
  if (stats.max_radius.size == 0) return;
  float& radius = stats.max_radius.data[gaussian];
  radius = Max(radius, 3 * LongAxis(PowerRoot<float>{splat.root_xx, splat.root_xy, splat.root_yy}));
}

PEPESEG_HD void UpdateGroup(ParameterJob& job, const Group& group, int64_t first, int count,
                            const int32_t* visible) {
  const UpdateArgs& args = *job.update;
  const uint32_t all = (1u << count) - 1u;
  Lanes grad[kMaxPlanes];
  SplatGradLanes splat_grad;
  const uint32_t seen = Transpose(group.grads, visible, count, splat_grad);
  uint32_t skipped = 0;
  if (seen != 0) {
    const GaussianGroup values = {args.gaussians.data + first, args.gaussians.stride, count};
    skipped = seen & ~ParameterVjp(group, values, splat_grad, grad);
    const LaneMask mask = MaskOf(seen & ~skipped);
    for (int k = 0; k < group.num_planes; ++k) grad[k] = Select(mask, grad[k], Lanes(0.0f));
    for (uint32_t bits = seen & ~skipped; bits != 0; bits &= bits - 1) {
      const int i = __builtin_ctz(bits);
      AddStats(args, first + i, group.splats[visible[i]], group.grads[visible[i]]);
    }
  } else {
    for (int k = 0; k < group.num_planes; ++k) grad[k] = Lanes(0.0f);
  }
  job.num_skipped += __builtin_popcount(skipped);
  AdamGroup(job, group.num_planes, first, count, grad, all & ~skipped);
}

PEPESEG_HD void StoreGradients(const ParameterJob& job, const Group& group, int64_t first,
                               int count, const int32_t* visible) {
  const ProjectBackwardArgs& args = *job.grad;
  Lanes grad[kMaxPlanes];
  SplatGradLanes splat_grad;
  const uint32_t seen = Transpose(group.grads, visible, count, splat_grad);
  if (seen != 0) {
    const GaussianGroup values = {args.gaussians.data + first, args.gaussians.stride, count};
    ParameterVjp(group, values, splat_grad, grad);
  }
  const LaneMask mask = MaskOf(seen);
  const int degree = args.grad.sh_degree;
  for (int k = 0; k < kShPlane + 3 * (degree + 1) * (degree + 1); ++k) {
    const bool active = seen != 0 && k < group.num_planes;
    const Lanes value = active ? Select(mask, grad[k], Lanes(0.0f)) : Lanes(0.0f);
    StoreSome(value, args.grad.data + k * args.grad.stride + first, count);
  }
}

}  // namespace

void UpdateParameters(ParameterJob& job) {
  const bool updates = job.update != nullptr;
  const int degree = updates ? job.update->active_sh_degree : job.grad->active_sh_degree;
  Group group;
  group.camera = MakeProjectionCamera<Lanes>(updates ? job.update->view : job.grad->view);
  group.splats = job.splats;
  group.grads = job.grads;
  group.degree = degree;
  group.num_planes = kShPlane + 3 * (degree + 1) * (degree + 1);
  job.num_skipped = 0;
  for (int64_t i = 0; i < job.count; i += kLanes) {
    const int count = job.count - i < kLanes ? static_cast<int>(job.count - i) : kLanes;
    if (updates) {
      UpdateGroup(job, group, job.first + i, count, job.visible + i);
    } else {
      StoreGradients(job, group, job.first + i, count, job.visible + i);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
