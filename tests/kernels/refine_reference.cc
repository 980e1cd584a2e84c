#include "tests/kernels/refine_reference.h"

#include <algorithm>
#include <cmath>

// Finds refinements with nothing of kernels/math.

namespace pepeseg {
namespace {

using Vector = std::array<double, 3>;
struct Point {
  double x, y;
};

constexpr double kWalk = 0.01;  // pixels of one step along the axis

// from + length * direction.
Vector Along(const Vector& from, const Vector& direction, double length) {
  return {from[0] + length * direction[0], from[1] + length * direction[1],
          from[2] + length * direction[2]};
}

// Projects a point of the world, pixels.
Point OnScreen(const PinholeView& view, const Vector& world) {
  const float* m = view.cam_from_world;
  double p[3];
  for (int r = 0; r < 3; ++r) {
    p[r] = m[4 * r + 3];
    for (int c = 0; c < 3; ++c) p[r] += m[4 * r + c] * world[c];
  }
  return {view.fx * p[0] / p[2] + view.cx, view.fy * p[1] / p[2] + view.cy};
}

// Returns an axis of a Gaussian in space, as the rotation q e q* of a unit vector.
Vector SpaceAxis(const HostGaussians& scene, int64_t i, int axis) {
  double q[4], norm = 0;
  for (int k = 0; k < 4; ++k) {
    q[k] = scene.At(kRotationPlane + k, i);
    norm += q[k] * q[k];
  }
  const double w = q[0], u[3] = {q[1], q[2], q[3]};
  Vector out{};
  out[axis] = (w * w - u[0] * u[0] - u[1] * u[1] - u[2] * u[2]) / norm;
  for (int k = 0; k < 3; ++k) out[k] += 2 * u[axis] * u[k] / norm;
  out[(axis + 1) % 3] += 2 * w * u[(axis + 2) % 3] / norm;
  out[(axis + 2) % 3] -= 2 * w * u[(axis + 1) % 3] / norm;
  return out;
}

// A Gaussian on screen.
struct ScreenGaussian {
  Point mean;
  Vector axes[3];   // in space, unit
  Point images[3];  // of one standard deviation along each axis, pixels
  double sigma[3];
  Point major;       // unit
  double deviation;  // along it, pixels
  bool round;        // no clear major axis
};

// Projects a Gaussian, with the Jacobian by differences.
ScreenGaussian Project(const HostGaussians& scene, int64_t i, const PinholeView& view) {
  ScreenGaussian out = {};
  const Vector mean = {scene.At(0, i), scene.At(1, i), scene.At(2, i)};
  out.mean = OnScreen(view, mean);
  double xx = 0, xy = 0, yy = 0;
  for (int k = 0; k < 3; ++k) {
    constexpr double kStep = 1e-5;
    out.axes[k] = SpaceAxis(scene, i, k);
    out.sigma[k] = std::exp(double{scene.At(kLogScalePlane + k, i)});
    const Point a = OnScreen(view, Along(mean, out.axes[k], kStep));
    const Point b = OnScreen(view, Along(mean, out.axes[k], -kStep));
    const double scale = out.sigma[k] / (2 * kStep);
    out.images[k] = {scale * (a.x - b.x), scale * (a.y - b.y)};
    xx += out.images[k].x * out.images[k].x;
    xy += out.images[k].x * out.images[k].y;
    yy += out.images[k].y * out.images[k].y;
  }
  const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
  out.major = {std::cos(angle), std::sin(angle)};
  const double root = std::hypot(0.5 * (xx - yy), xy);
  out.deviation = std::sqrt(0.5 * (xx + yy) + root);
  out.round = root < 0.05 * (xx + yy);
  return out;
}

// A walk along the major axis; s counts steps of kWalk from its middle.
class Walk {
 public:
  Walk(const ScreenGaussian& gaussian, const PinholeView& view, Point shift)
      : mean_{gaussian.mean.x + shift.x, gaussian.mean.y + shift.y},
        direction_(gaussian.major),
        view_(view) {}
  bool InImage(int s) const {
    const Point p = At(s);
    return p.x >= 0 && p.y >= 0 && p.x < view_.width && p.y < view_.height;
  }
  bool Covered(const std::vector<uint8_t>& mask, int s) const {
    const Point p = At(s);
    return mask[static_cast<int>(p.y) * view_.width + static_cast<int>(p.x)] != 0;
  }

 private:
  Point At(int s) const {
    return {mean_.x + kWalk * s * direction_.x, mean_.y + kWalk * s * direction_.y};
  }
  Point mean_, direction_;
  const PinholeView& view_;
};

struct Crossing {
  int mask = -1;
  bool ahead = false;  // the end at positive s is inside the mask
  double share = 0;
};

// Finds the crossing of a Gaussian's major axis, moved by `shift` pixels.
Crossing Cross(const ScreenGaussian& gaussian, const PinholeView& view, const MaskImages& masks,
               Point shift) {
  const Walk walk(gaussian, view, shift);
  const int reach = static_cast<int>(3 * gaussian.deviation / kWalk);
  if (3 * gaussian.deviation < 1 || !walk.InImage(0)) return {};
  int first = 0, last = 0;
  while (first > -reach && walk.InImage(first - 1)) --first;
  while (last < reach && walk.InImage(last + 1)) ++last;
  // An axis that leaves the image at both ends is not refined.
  if (first > -reach && last < reach) return {};
  Crossing out;
  int64_t smallest = 0;
  for (size_t mask = 0; mask < masks.size(); ++mask) {
    if (walk.Covered(masks[mask], first) == walk.Covered(masks[mask], last)) continue;
    const int64_t area = std::count(masks[mask].begin(), masks[mask].end(), 1);
    if (out.mask >= 0 && area >= smallest) continue;
    smallest = area;
    out.mask = static_cast<int>(mask);
  }
  if (out.mask < 0) return {};
  out.ahead = walk.Covered(masks[out.mask], last);
  // From the end inside to the first exit.
  int s = out.ahead ? last : first;
  while (walk.Covered(masks[out.mask], s)) s += out.ahead ? -1 : 1;
  const double length = out.ahead ? reach - s : reach + s;
  out.share = std::clamp(length / (2 * reach), 0.05, 1.0);
  return out;
}

}  // namespace

ReferenceRefinement RefineReference(const HostGaussians& scene, int64_t i, const PinholeView& view,
                                    const MaskImages& masks) {
  const ScreenGaussian g = Project(scene, i, view);
  ReferenceRefinement out;
  double span[3];
  for (int k = 0; k < 3; ++k) span[k] = g.images[k].x * g.major.x + g.images[k].y * g.major.y;
  for (int k = 1; k < 3; ++k) {
    if (std::abs(span[k]) > std::abs(span[out.axis])) out.axis = k;
  }
  const double carried = std::abs(span[out.axis]);
  const Crossing crossing = Cross(g, view, masks, {0, 0});
  out.refined = crossing.mask >= 0 && carried >= 0.8 * g.deviation;
  out.share = crossing.share;
  const double sign = (span[out.axis] > 0) == crossing.ahead ? 3 : -3;
  for (int k = 0; k < 3; ++k) out.to_end[k] = sign * g.sigma[out.axis] * g.axes[out.axis][k];

  // Close calls: no clear major axis, a value near its limit, two axes that span nearly the same,
  // or another outcome if the Gaussian moves by 0.02 pixels.
  out.close_call = g.round || std::abs(carried / g.deviation - 0.8) < 0.01 ||
                   std::abs(3 * g.deviation - 1) < 0.02;
  for (int k = 0; k < 3; ++k) {
    out.close_call |= k != out.axis && std::abs(span[k]) > 0.98 * carried;
  }
  for (const Point shift : {Point{0.02, 0}, Point{-0.02, 0}, Point{0, 0.02}, Point{0, -0.02}}) {
    const Crossing other = Cross(g, view, masks, shift);
    out.close_call |= other.mask != crossing.mask || other.ahead != crossing.ahead ||
                      std::abs(other.share - crossing.share) > 0.05;
  }
  return out;
}

}  // namespace pepeseg
