#pragma once

#include <cstdint>

#include "kernels/math/projection.h"

// Refinement of one Gaussian in one view (METHOD.md section 1, "Refinement"): finds where its major
// axis on screen crosses the border of a mask, and cuts it there. Templates on a plain scalar only,
// not on vector lanes. Points and lengths on screen are in pixels, others in scene units. The
// argument structs are in kernels/ops/refine.h.

namespace pepeseg {

inline constexpr float kAxisReach = 3;    // standard deviations from the mean to an end of the axis
inline constexpr float kMinHalfAxis = 1;  // pixels; a shorter axis is not cut
inline constexpr float kMaxVariance = 1e12f;   // pixels^2; beyond it both ends leave any image
inline constexpr float kMinAxisShare = 0.05f;  // least share of the axis that a part keeps
// Least share of the axis on screen that the longest-appearing axis in space must account for.
inline constexpr float kMinCarriedAxis = 0.8f;
inline constexpr float kMinRefinementAlpha = 0.5f;  // fainter pixels have no depth

// The masks of a view as the formulas read them; see PatchMap of kernels/ops/refine.h.
struct PatchMapView {
  int width, height;           // pixels
  int words, num_masks;        // 64-bit words of a bitset, number of masks
  const uint32_t* pixel_cell;  // [H, W] -> mask cell
  const uint64_t* cell_bits;   // [cells, words] masks of each cell
  const int64_t* mask_area;    // [num_masks] pixels

  // Bitset of the masks that cover a pixel.
  PEPESEG_HD const uint64_t* BitsAt(int x, int y) const {
    return cell_bits +
           static_cast<int64_t>(pixel_cell[static_cast<int64_t>(y) * width + x]) * words;
  }
};

// `masks` is a PatchMap, `view` a PinholeView.
template <class Masks, class View>
PatchMapView MakePatchMapView(const Masks& masks, const View& view) {
  return {view.width,
          view.height,
          masks.words,
          static_cast<int>(masks.mask_area.size),
          masks.pixel_cell.data,
          masks.cell_bits.data,
          masks.mask_area.data};
}

// Returns the smallest of the masks that cover exactly one of two pixels, the first of equal ones,
// or -1 if there is none. `a` and `b` are the bitsets of the pixels.
PEPESEG_HD int SmallestCrossedMask(const PatchMapView& map, const uint64_t* a, const uint64_t* b) {
  int smallest = -1;
  for (int word = 0; word < map.words; ++word) {
    uint64_t differ = a[word] ^ b[word];
    for (int mask = 64 * word; differ != 0; ++mask, differ >>= 1) {
      if ((differ & 1) == 0) continue;
      if (smallest < 0 || map.mask_area[mask] < map.mask_area[smallest]) smallest = mask;
    }
  }
  return smallest;
}

template <class T>
struct Point2 {
  T x, y;
};

// The longer principal axis of a covariance: a unit direction and the standard deviation along it.
template <class T>
struct PrincipalAxis {
  Point2<T> direction;
  T deviation;
};
template <class T>
PEPESEG_HD PrincipalAxis<T> MajorAxis(const Sym2<T>& cov) {
  const T mid = T(0.5f) * (cov.xx + cov.yy), half = T(0.5f) * (cov.xx - cov.yy);
  const T root = Sqrt(half * half + cov.xy * cov.xy);
  // Uses the form of the eigenvector in which nothing cancels.
  const bool wide = half >= T(0);
  const T x = wide ? half + root : cov.xy, y = wide ? cov.xy : root - half;
  const T norm = Sqrt(x * x + y * y);
  const T deviation = Sqrt(mid + root);
  if (!(norm > T(0))) return {{T(1), T(0)}, deviation};
  return {{x / norm, y / norm}, deviation};
}

// Distance that a ray from inside [0, width] x [0, height] goes until it leaves it, at most
// `length`.
template <class T>
PEPESEG_HD T DistanceToEdge(const PatchMapView& map, Point2<T> from, Point2<T> direction,
                            T length) {
  const T to_x = (direction.x > T(0) ? T(map.width) - from.x : from.x) / Abs(direction.x);
  const T to_y = (direction.y > T(0) ? T(map.height) - from.y : from.y) / Abs(direction.y);
  // Where a component of the direction is 0, to_x or to_y is infinite or NaN, and `length` stays.
  T distance = length;
  if (to_x < distance) distance = to_x;
  if (to_y < distance) distance = to_y;
  return distance;
}

struct Pixel {
  int x, y;
};
// The pixel that holds a point of the closed image [0, width] x [0, height].
template <class T>
PEPESEG_HD Pixel PixelAt(const PatchMapView& map, Point2<T> point) {
  const int x = static_cast<int>(point.x), y = static_cast<int>(point.y);
  return {x < map.width ? x : map.width - 1, y < map.height ? y : map.height - 1};
}

// Distance that a ray goes, pixel by pixel (Amanatides and Woo 1987), until it enters one that the
// mask does not cover or leaves the image; at most `length`.
template <class T>
PEPESEG_HD T DistanceToExit(const PatchMapView& map, int mask, Point2<T> from, Point2<T> direction,
                            T length) {
  // next_x and next_y are the distances to the next vertical and horizontal border of a pixel.
  // `far` bounds them where the ray is parallel to the border.
  const bool right = direction.x > T(0), down = direction.y > T(0);
  const T far = T(4) * T(map.width + map.height);
  const T per_x = T(1) / Max(Abs(direction.x), T(1e-9f));
  const T per_y = T(1) / Max(Abs(direction.y), T(1e-9f));
  Pixel pixel = PixelAt(map, from);
  T next_x = Min(far, per_x * Abs(T(pixel.x + (right ? 1 : 0)) - from.x));
  T next_y = Min(far, per_y * Abs(T(pixel.y + (down ? 1 : 0)) - from.y));
  T distance = T(0);
  while (distance < length) {
    const uint64_t word = map.BitsAt(pixel.x, pixel.y)[mask / 64];
    if ((word >> (mask % 64) & 1) == 0) return distance;
    if (next_x < next_y) {
      distance = next_x;
      next_x += per_x;
      pixel.x += right ? 1 : -1;
    } else {
      distance = next_y;
      next_y += per_y;
      pixel.y += down ? 1 : -1;
    }
    if (pixel.x < 0 || pixel.x >= map.width || pixel.y < 0 || pixel.y >= map.height) break;
  }
  return Min(distance, length);
}

// Where the axis from mean - reach * direction to mean + reach * direction leaves a mask.
template <class T>
struct MaskCrossing {
  bool found;
  T inside;  // +1 or -1: the end that the mask covers
  T share;   // r: share of the axis from that end to the first exit, in [kMinAxisShare, 1]
};
// `mean` must lie in the image; `direction` has length 1. The smallest mask that covers exactly one
// end decides. If one end lies outside the image, the axis is followed up to the edge, and the mask
// is assumed to continue beyond it; if both do, nothing is found.
template <class T>
PEPESEG_HD MaskCrossing<T> FindCrossing(const PatchMapView& map, Point2<T> mean,
                                        Point2<T> direction, T reach) {
  const MaskCrossing<T> none = {false, T(0), T(0)};
  const Point2<T> back = {T(0) - direction.x, T(0) - direction.y};
  const T ahead = DistanceToEdge(map, mean, direction, reach);
  const T behind = DistanceToEdge(map, mean, back, reach);
  if (reach < T(kMinHalfAxis) || (ahead < reach && behind < reach)) return none;
  const Point2<T> end = {mean.x + ahead * direction.x, mean.y + ahead * direction.y};
  const Point2<T> begin = {mean.x + behind * back.x, mean.y + behind * back.y};
  const Pixel end_pixel = PixelAt(map, end), begin_pixel = PixelAt(map, begin);
  const uint64_t* end_bits = map.BitsAt(end_pixel.x, end_pixel.y);
  const int mask = SmallestCrossedMask(map, end_bits, map.BitsAt(begin_pixel.x, begin_pixel.y));
  if (mask < 0) return none;
  const bool ends_inside = (end_bits[mask / 64] >> (mask % 64) & 1) != 0;
  const T walked = DistanceToExit(map, mask, ends_inside ? end : begin,
                                  ends_inside ? back : direction, ahead + behind);
  const T beyond_edge = reach - (ends_inside ? ahead : behind);
  const T share = (beyond_edge + walked) / (T(2) * reach);
  return {true, ends_inside ? T(1) : T(-1), Min(Max(share, T(kMinAxisShare)), T(1))};
}

// The axis in space that crosses the border of a mask.
template <class T>
struct Refinement {
  bool found;
  T share;         // r: share of the axis inside the mask
  int axis;        // 0, 1 or 2: the axis of the Gaussian
  Vec3<T> to_end;  // from the mean to the end inside the mask, 3 standard deviations long
};
// Finds nothing if the mean is not in the image, or if no single axis in space makes up
// kMinCarriedAxis of the major axis on screen.
template <class T>
PEPESEG_HD Refinement<T> FindRefinement(const ProjectionCamera<T>& camera,
                                        const GaussianShape<T>& shape, const PatchMapView& map) {
  Refinement<T> out = {false, T(0), 0, {T(0), T(0), T(0)}};
  const Vec3<T> in_cam = MeanInCam(camera, shape.mean);
  const T inv_z = T(1) / in_cam.z;
  const Point2<T> mean = {camera.fx * in_cam.x * inv_z + camera.cx,
                          camera.fy * in_cam.y * inv_z + camera.cy};
  if (!(T(0) <= mean.x && mean.x < T(map.width) && T(0) <= mean.y && mean.y < T(map.height))) {
    return out;
  }
  const Mat3<T> rotation = RotationFromQuaternion(shape.rotation);
  const ProjectedAxes<T> axes = ProjectAxes(camera, in_cam, rotation);
  const Vec3<T> scale = {Exp(shape.log_scale.x), Exp(shape.log_scale.y), Exp(shape.log_scale.z)};
  const Sym2<T> cov = ProjectCovariance(axes, scale);
  if (!(cov.xx + cov.yy < T(kMaxVariance))) return out;
  const PrincipalAxis<T> major = MajorAxis(cov);
  // Signed extent of one standard deviation of each axis in space along the major axis on screen.
  const Vec3<T> spans = Scale(major.direction.x * axes.row0 + major.direction.y * axes.row1, scale);
  T span = spans.x;
  Vec3<T> axis = {rotation.row0.x, rotation.row1.x, rotation.row2.x};
  T deviation = scale.x;
  if (Abs(spans.y) > Abs(span)) {
    span = spans.y, deviation = scale.y, out.axis = 1;
    axis = {rotation.row0.y, rotation.row1.y, rotation.row2.y};
  }
  if (Abs(spans.z) > Abs(span)) {
    span = spans.z, deviation = scale.z, out.axis = 2;
    axis = {rotation.row0.z, rotation.row1.z, rotation.row2.z};
  }
  if (!(Abs(span) >= T(kMinCarriedAxis) * major.deviation)) return out;
  const MaskCrossing<T> crossing =
      FindCrossing(map, mean, major.direction, T(kAxisReach) * major.deviation);
  const T sign = span < T(0) ? T(0) - crossing.inside : crossing.inside;
  out.found = crossing.found;
  out.share = crossing.share;
  out.to_end = (T(kAxisReach) * sign * deviation) * axis;
  return out;
}

// The part of a Gaussian on one side of the border. Its 3-sigma segment along the axis is a share
// of the Gaussian's and ends where that ends: the part inside the mask has the share r and ends at
// +to_end, the part outside has 1 - r and ends at -to_end. For the part inside (METHOD.md section
// 1): sigma* = r sigma, mu* = mu + 3 (1 - r) sigma v.
template <class T>
PEPESEG_HD GaussianShape<T> PartOf(GaussianShape<T> shape, const Refinement<T>& refinement,
                                   bool outside) {
  const T share = outside ? T(1) - refinement.share : refinement.share;
  const T offset = outside ? share - T(1) : T(1) - share;
  shape.mean = shape.mean + offset * refinement.to_end;
  const T change = Log(share);
  shape.log_scale = shape.log_scale + Vec3<T>{refinement.axis == 0 ? change : T(0),
                                              refinement.axis == 1 ? change : T(0),
                                              refinement.axis == 2 ? change : T(0)};
  return shape;
}
// Returns whether the part outside is long enough to become a Gaussian.
template <class T>
PEPESEG_HD bool HasOutsidePart(const Refinement<T>& refinement) {
  return T(1) - refinement.share >= T(kMinAxisShare);
}

// Distance of a Gaussian at depth z from the rendered depth, by which candidates are ranked. -1:
// the pixel has no depth. `depth` is the sum of weight * z over the pixel; after a render of
// inverse depth both are of 1 / z.
template <class T>
PEPESEG_HD T DepthGap(T alpha, T depth, T z) {
  if (!(alpha > T(kMinRefinementAlpha))) return T(-1);
  const T gap = Abs(depth / alpha - z);
  return IsUsable(gap) ? gap : T(-1);
}

}  // namespace pepeseg
