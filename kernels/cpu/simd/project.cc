#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/math/blend.h"
#include "kernels/math/dropout.h"
#include "kernels/math/tile_cover.h"

// Projection, a Gaussian for each lane. Tests yield bits of lanes; a Gaussian that fails one is
// counted at the first test that it fails.

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Splats of a group, a lane each.
struct SplatLanes {
  float x[kLanes], y[kLanes], root_xx[kLanes], root_xy[kLanes], root_yy[kLanes], opacity[kLanes];
  float r[kLanes], g[kLanes], b[kLanes], depth[kLanes], min_power[kLanes], half_height[kLanes];
};

PEPESEG_HD uint32_t LanesBelow(int count) { return (1u << count) - 1u; }

// Computes the colours of a group seen along `dir`. Returns the lanes in which they are usable.
PEPESEG_HD uint32_t Colors(const ProjectJob& job, const GaussianGroup& group, Vec3<Lanes> dir,
                           SplatLanes& out) {
  const int degree = job.args->active_sh_degree;
  const int num_coefficients = (degree + 1) * (degree + 1);
  Lanes basis[16];
  ShBasis(dir, degree, basis);
  float* const channels[3] = {out.r, out.g, out.b};
  LaneMask usable = IsUsable(dir.x);
  for (int c = 0; c < 3; ++c) {
    const Lanes sum = WeightedSum(group, basis, num_coefficients, c);
    usable = usable & IsUsable(sum);
    ShChannel(sum).Store(channels[c]);
  }
  return BitsOf(usable);
}

// Returns the lanes that dropout leaves out. `first` is the index of the group's first Gaussian.
PEPESEG_HD uint32_t LeftOut(const Dropout& dropout, int64_t first, int count) {
  uint32_t bits = 0;
  if (dropout.share <= 0) return bits;
  for (int i = 0; i < count; ++i) {
    const bool is_left_out =
        IsLeftOut(dropout.share, dropout.seed, static_cast<uint32_t>(first + i));
    bits |= static_cast<uint32_t>(is_left_out) << i;
  }
  return bits;
}

// Projects a group. Returns the lanes that are in front of the camera, usable and in reach of the
// image, and counts the degenerate ones. Colours are evaluated only if there is any such lane.
PEPESEG_HD uint32_t ProjectGroup(ProjectJob& job, int64_t first, const GaussianGroup& group,
                                 const ProjectionCamera<Lanes>& camera, SplatLanes& out) {
  const RenderArgs& args = *job.args;
  const uint32_t all = LanesBelow(group.count) & ~LeftOut(args.dropout, first, group.count);
  const GaussianShape<Lanes> shape = LoadShape(group);
  const Lanes depth = MeanInCam(camera, shape.mean).z;
  const uint32_t finite = BitsOf(IsUsable(depth));
  const uint32_t in_front = finite & all & BitsOf(Lanes(args.near_plane) < depth);
  job.num_degenerate += __builtin_popcount(all & ~finite);
  if (in_front == 0) return 0;

  const Projection<Lanes> p = Project(camera, shape);
  const Lanes opacity = Lanes(OpacityFactor(args.dropout.share)) * Sigmoid(group.At(kOpacityPlane));
  const LaneMask sound =
      IsUsable(p.x) & IsUsable(p.y) & IsUsable(p.conic.xy) & (Lanes(0.0f) < p.conic.xx) &
      IsUsable(p.conic.xx) & (Lanes(0.0f) < p.conic.yy) & IsUsable(p.conic.yy) &
      (Lanes(0.0f) < p.determinant) & IsUsable(p.determinant) &
      (Lanes(kMinSquaredQuaternion) < SquaredNorm(shape.rotation)) & IsUsable(opacity);
  const uint32_t usable = in_front & BitsOf(sound);
  job.num_degenerate += __builtin_popcount(in_front & ~usable);

  const Lanes min_power = MinPower(opacity);
  const PowerRoot<Lanes> root = MakePowerRoot(p.conic.xx, p.conic.xy, p.determinant);
  const HalfExtent<Lanes> half = SplatHalfExtent(min_power, root.yy, p.conic.yy, p.determinant);
  const LaneMask inside =
      (Lanes(0.0f) < p.x + half.width) & (p.x - half.width < Lanes(float(args.view.width))) &
      (Lanes(0.0f) < p.y + half.height) & (p.y - half.height < Lanes(float(args.view.height)));
  const uint32_t seen = usable & BitsOf(inside & (min_power < Lanes(0.0f)));
  if (seen == 0) return 0;
  const uint32_t colored = Colors(job, group, Normalize(shape.mean - CameraCenter(camera)), out);
  job.num_degenerate += __builtin_popcount(seen & ~colored);
  p.x.Store(out.x);
  p.y.Store(out.y);
  root.xx.Store(out.root_xx);
  root.xy.Store(out.root_xy);
  root.yy.Store(out.root_yy);
  opacity.Store(out.opacity);
  depth.Store(out.depth);
  min_power.Store(out.min_power);
  half.height.Store(out.half_height);
  return seen & colored;
}

}  // namespace

// Writes the visible lanes of each group one after another, so that outputs have no gaps.
void ProjectGaussians(ProjectJob& job) {
  const ProjectionCamera<Lanes> camera = MakeProjectionCamera<Lanes>(job.args->view);
  const auto& planes = job.args->gaussians;
  job.num_out = job.num_degenerate = 0;
  for (int64_t first = 0; first < job.count; first += kLanes) {
    const int64_t left = job.count - first;
    const GaussianGroup group = {planes.data + job.first + first, planes.stride,
                                 left < kLanes ? static_cast<int>(left) : kLanes};
    SplatLanes s;
    for (uint32_t bits = ProjectGroup(job, job.first + first, group, camera, s); bits != 0;
         bits &= bits - 1) {
      const int i = __builtin_ctz(bits);
      job.gaussian[job.num_out] = static_cast<int32_t>(job.first + first + i);
      job.splat[job.num_out++] = {s.x[i],       s.y[i],       s.root_xx[i],   s.root_xy[i],
                                  s.root_yy[i], s.opacity[i], s.r[i],         s.g[i],
                                  s.b[i],       s.depth[i],   s.min_power[i], s.half_height[i]};
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
