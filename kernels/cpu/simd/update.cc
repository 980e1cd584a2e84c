#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/math/adam.h"
#include "kernels/math/blend.h"
#include "kernels/math/dropout.h"

// Backward pass of the projection, a Gaussian for each lane, and Adam. A block of Gaussians first
// gets all its gradients, for each step, and then Adam plane by plane and step by step. Gaussians
// that are not visible take part in Adam with the gradient 0; those with a gradient that is not
// finite are masked out of it.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

constexpr int kMaxPlanes = NumPlanes(kMaxShDegree);

// The ten gradients of SplatGrad, in their order, for the lanes of a group.
struct SplatGradLanes {
  alignas(64) float values[10][kLanes];
};

// Inputs of one step. All groups of a job use them.
struct Group {
  int step;  // index into UpdateArgs::steps
  ProjectionCamera<Lanes> camera;
  const Splat* splats;     // [visible]
  const SplatGrad* grads;  // [visible]
  int degree;
  int num_planes;  // planes of the active degree
  float opacity_factor;
};

PEPESEG_HD Lanes Field(const SplatGradLanes& g, int field) { return Lanes::Load(g.values[field]); }

// Transposes the gradients of the group's visible Gaussians and returns their lanes. `visible`
// holds an index into `grads` or -1. The other lanes are 0.
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

// Backward pass of the colour: fills the SH planes of `grad` and returns the gradient of the offset
// from the camera to the mean.
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

// Turns the gradients of the splats into those of all active planes. Lanes that are not visible
// hold arbitrary values. Returns the lanes in which all gradients are finite and below 1e30.
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
  grad[kOpacityPlane] =
      SigmoidVjp(Sigmoid(values.At(kOpacityPlane)), Lanes(group.opacity_factor) * Field(s, 5));
  LaneMask usable = IsUsable(grad[0]);
  for (int k = 1; k < group.num_planes; ++k) usable = usable & IsUsable(grad[k]);
  return BitsOf(usable);
}

// The inverse of BitsOf.
PEPESEG_HD LaneMask MaskOf(uint32_t bits) {
  const uint8_t bytes[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
  return {hn::LoadMaskBits(FloatTag(), bytes)};
}

// Learning rate of a plane.
PEPESEG_HD float RateOf(const LearningRates& rates, int plane) {
  if (plane < kLogScalePlane) return rates.mean;
  if (plane < kRotationPlane) return rates.log_scale;
  if (plane < kOpacityPlane) return rates.rotation;
  if (plane < kShPlane) return rates.opacity;
  return plane < kShPlane + 3 ? rates.sh_dc : rates.sh_rest;
}

// Counts the steps of the Gaussians that are updated and looks up their bias corrections.
PEPESEG_HD void CountSteps(const ParameterJob& job, int64_t first, int count, UpdateBlock& block) {
  int32_t* const num_steps = job.update->num_steps.data + first;
  for (int i = 0; i < kUpdateBlock; ++i) {
    int32_t step = 1;
    if (i < count) {
      num_steps[i] += static_cast<int32_t>(block.updated[i / kLanes] >> (i % kLanes) & 1u);
      step = Min(Max(num_steps[i], 1), job.num_corrections - 1);
    }
    block.correction1[i] = job.correction1[step];
    block.correction2[i] = job.correction2[step];
  }
}

// Runs Adam on one plane of a block, and clamps log scales to their bounds.
PEPESEG_HD void AdamPlane(const UpdateArgs& args, int plane, int64_t first, int count,
                          const UpdateBlock& block) {
  const Lanes learning_rate(RateOf(args.learning_rates, plane));
  const bool bounded =
      args.max_log_scale > args.min_log_scale && plane >= kLogScalePlane && plane < kRotationPlane;
  float* const value_at = args.gaussians.data + plane * args.gaussians.stride + first;
  float* const moment1_at = args.moment1.data + plane * args.moment1.stride + first;
  float* const moment2_at = args.moment2.data + plane * args.moment2.stride + first;
  for (int i = 0; i < count; i += kLanes) {
    // The next plane is far away in memory: the processor does not foresee that it follows.
    __builtin_prefetch(value_at + args.gaussians.stride + i, 1);
    __builtin_prefetch(moment1_at + args.moment1.stride + i, 1);
    __builtin_prefetch(moment2_at + args.moment2.stride + i, 1);
    const int left = count - i;
    const AdamRates<Lanes> rates = {Lanes(args.beta1), Lanes(args.beta2), Lanes(args.epsilon),
                                    Lanes::Load(block.correction1 + i),
                                    Lanes::Load(block.correction2 + i)};
    const Lanes old = LoadSome(value_at + i, left);
    const Lanes old1 = LoadSome(moment1_at + i, left), old2 = LoadSome(moment2_at + i, left);
    Lanes moment1 = old1, moment2 = old2;
    const Lanes grad = Lanes::Load(block.values[plane] + i);
    Lanes value = old + AdamStep(rates, learning_rate, grad, moment1, moment2);
    if (bounded) value = Min(Max(value, Lanes(args.min_log_scale)), Lanes(args.max_log_scale));
    const LaneMask mask = MaskOf(block.updated[i / kLanes]);
    StoreSome(Select(mask, value, old), value_at + i, left);
    StoreSome(Select(mask, moment1, old1), moment1_at + i, left);
    StoreSome(Select(mask, moment2, old2), moment2_at + i, left);
  }
}

// Adds one visible Gaussian to the statistics that are kept, see DensityStats.
PEPESEG_HD void AddStats(const UpdateArgs& args, const PinholeView& view, int64_t gaussian,
                         const Splat& splat, const SplatGrad& grad) {
  const DensityStats& stats = args.stats;
  if (stats.mean2d_grad_sum.size > 0) {
    const float gx = grad.x * 0.5f * static_cast<float>(view.width);
    const float gy = grad.y * 0.5f * static_cast<float>(view.height);
    stats.mean2d_grad_sum.data[gaussian] += Sqrt(gx * gx + gy * gy);
  }
  if (stats.square_sum.size > 0) stats.square_sum.data[gaussian] += grad.squares;
  if (stats.num_visible.size > 0) ++stats.num_visible.data[gaussian];
  if (stats.max_radius.size == 0) return;
  float& radius = stats.max_radius.data[gaussian];
  radius = Max(radius, 3 * LongAxis(PowerRoot<float>{splat.root_xx, splat.root_xy, splat.root_yy}));
}

// Computes gradients and statistics of one group, which starts at `at` in the block. Gradients are
// 0 in lanes that are not visible or not finite; the latter are counted as skipped.
PEPESEG_HD void FillGroup(ParameterJob& job, const Group& group, int64_t first, int count,
                          const int32_t* visible, int at, UpdateBlock& block) {
  const UpdateArgs& args = *job.update;
  SplatGradLanes splat_grad;
  const uint32_t seen = Transpose(group.grads, visible, count, splat_grad);
  block.updated[at / kLanes] = (1u << count) - 1u;
  if (seen == 0) {
    for (int k = 0; k < group.num_planes; ++k) Lanes(0.0f).Store(block.values[k] + at);
    return;
  }
  Lanes grad[kMaxPlanes];
  const GaussianGroup values = {args.gaussians.data + first, args.gaussians.stride, count};
  // The next group reads a cache line of every plane.
  for (int k = 0; k < group.num_planes; ++k) {
    __builtin_prefetch(values.data + k * values.stride + kLanes, 1);
  }
  const uint32_t used = seen & ParameterVjp(group, values, splat_grad, grad);
  const LaneMask mask = MaskOf(used);
  for (int k = 0; k < group.num_planes; ++k) {
    Select(mask, grad[k], Lanes(0.0f)).Store(block.values[k] + at);
  }
  for (uint32_t bits = used; bits != 0; bits &= bits - 1) {
    const int i = __builtin_ctz(bits);
    AddStats(args, job.steps[group.step].view, first + i, group.splats[visible[i]],
             group.grads[visible[i]]);
  }
  block.updated[at / kLanes] &= ~(seen & ~used);
  job.num_skipped[group.step] += __builtin_popcount(seen & ~used);
}

// The block begins at `at` of the job. All gradients come before the first step of Adam, which
// changes what they are taken at.
PEPESEG_HD void StepBlock(ParameterJob& job, const Group* groups, int64_t at, int count) {
  const int64_t first = job.first + at;
  for (int k = 0; k < job.num_steps; ++k) {
    for (int i = 0; i < count; i += kLanes) {
      FillGroup(job, groups[k], first + i, Min(count - i, kLanes), job.visible[k] + at + i, i,
                job.blocks[k]);
    }
  }
  for (int k = 0; k < job.num_steps; ++k) CountSteps(job, first, count, job.blocks[k]);
  for (int plane = 0; plane < groups[0].num_planes; ++plane) {
    for (int k = 0; k < job.num_steps; ++k) {
      AdamPlane(*job.update, plane, first, count, job.blocks[k]);
    }
  }
}

PEPESEG_HD Group MakeGroup(const ParameterJob& job, int step) {
  const UpdateStep& its = job.steps[step];
  const int degree = job.update->active_sh_degree;
  Group group;
  group.step = step;
  group.camera = MakeProjectionCamera<Lanes>(its.view);
  group.splats = its.scratch->visible_splat.span().data;
  group.grads = its.scratch->visible_grad.span().data;
  group.degree = degree;
  group.num_planes = kShPlane + 3 * (degree + 1) * (degree + 1);
  group.opacity_factor = OpacityFactor(its.dropout.share);
  return group;
}

}  // namespace

void UpdateParameters(ParameterJob& job) {
  Group groups[kMaxUpdateSteps];
  for (int k = 0; k < job.num_steps; ++k) {
    groups[k] = MakeGroup(job, k);
    job.num_skipped[k] = 0;
  }
  for (int64_t i = 0; i < job.count; i += kUpdateBlock) {
    const int64_t left = job.count - i;
    StepBlock(job, groups, i, left < kUpdateBlock ? static_cast<int>(left) : kUpdateBlock);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
