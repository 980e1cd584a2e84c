#include "core/edit/patches.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/order_statistics.h"
#include "core/base/status_macros.h"
#include "core/edit/cast_shadow.h"
#include "core/edit/hole_picture.h"
#include "core/scene/camera.h"
#include "kernels/gaussian_planes.h"
#include "kernels/math/sh.h"

namespace pepeseg {
namespace {

constexpr double kMinKnown = 0.5;      // share of a hole's border that must be known
constexpr double kSizeInPixels = 0.6;  // of a patch: it overlaps its neighbours
constexpr double kThickness = 0.1;     // of a patch, in its size
constexpr double kOpacity = 0.98;
constexpr float kKnownAlpha = 0.9f;
constexpr int kMinSide = 64, kMaxSide = 320;  // of a plane's picture, pixels
// Half of it: in the reach of the thing on the plane, and for its shadow in its height.
constexpr double kPictureReach = 1.5, kShadowLength = 1.5;
constexpr double kSlabTolerances = 4;    // the picture shows Gaussians so near to the plane
constexpr double kOutlineMargin = 0.06;  // around the thing's outline, of its reach
constexpr double kMostOfThing = 0.98;    // the others may be strays
constexpr int kStride = 2;               // pixels between patches in a view
constexpr double kFrontRadii = 1;        // what is nearer than the thing's center by this covers it

Eigen::Vector3d ColorAt(const Image& image, size_t pixel) {
  const uint8_t* rgb = image.pixels.data() + 3 * pixel;
  return Eigen::Vector3d(rgb[0], rgb[1], rgb[2]) / 255;
}

// Returns the corners of the convex hull of some points, in order (Andrew's monotone chain).
std::vector<Eigen::Vector2d> HullOf(std::vector<Eigen::Vector2d> points) {
  std::ranges::sort(points, [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  const auto turns_left = [](const auto& a, const auto& b, const auto& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x()) > 0;
  };
  std::vector<Eigen::Vector2d> hull;
  for (int side = 0; side < 2; ++side) {
    const size_t first = hull.size();
    for (const Eigen::Vector2d& p : points) {
      while (hull.size() >= first + 2 && !turns_left(hull[hull.size() - 2], hull.back(), p)) {
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();  // the first corner of the other side
    std::ranges::reverse(points);
  }
  return hull;
}

// Returns whether a point is in a convex hull, or at most `margin` outside of it.
bool IsInside(const std::vector<Eigen::Vector2d>& hull, const Eigen::Vector2d& p, double margin) {
  if (hull.size() == 2) {  // the points are on a line, or are one
    const Eigen::Vector2d along = hull[1] - hull[0];
    const double length = along.squaredNorm();
    const double share = length > 0 ? std::clamp((p - hull[0]).dot(along) / length, 0.0, 1.0) : 0.0;
    return (hull[0] + share * along - p).norm() <= margin;
  }
  for (size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d along = (hull[(i + 1) % hull.size()] - hull[i]).normalized();
    const Eigen::Vector2d to = p - hull[i];
    if (along.x() * to.y() - along.y() * to.x() < -margin) return false;
  }
  return !hull.empty();
}

// A picture of a plane, and how its pixels and the plane correspond.
struct PlanePicture {
  ModelView view;
  double reach = 0;  // of the thing on the plane from its middle, scene units
  double pixel = 0;  // width of a pixel on the plane, scene units

  // Returns the point of the plane at the centre of a pixel.
  Eigen::Vector3d PointAt(const SupportPlane& plane, int x, int y) const {
    const Pose world_from_cam = view.cam_from_world.Inverse();
    const Eigen::Vector3d ray(x + 0.5 - view.camera.cx, y + 0.5 - view.camera.cy, view.camera.fx);
    const Eigen::Vector3d direction = world_from_cam.rotation * ray;
    const Eigen::Vector3d& eye = world_from_cam.translation;
    return eye - plane.Above(eye) / plane.normal.dot(direction) * direction;
  }
};

PlanePicture PictureOf(const SupportPlane& plane, std::span<const Eigen::Vector3d> thing,
                       double scene_radius) {
  PlanePicture picture;
  std::vector<double> reaches, heights;
  for (const Eigen::Vector3d& p : thing) {
    const Eigen::Vector3d on_plane = p - plane.Above(p) * plane.normal;
    reaches.push_back((on_plane - plane.point).norm());
    heights.push_back(plane.Above(p));
  }
  // At least that of a thing that is one point on the plane.
  picture.reach = std::max(plane.tolerance, NearestRank(reaches, kMostOfThing));
  const double height = std::max(0.0, NearestRank(heights, kMostOfThing));
  const double half = kPictureReach * picture.reach + kShadowLength * height;
  const int side = static_cast<int>(std::clamp(2 * half / std::max(plane.spacing, 1e-9 * half),
                                               double{kMinSide}, double{kMaxSide}));
  picture.pixel = 2 * half / side;
  // In front of the near plane of renders, at a hundredth of the scene's radius.
  const double distance = std::max(3 * half, 0.05 * scene_radius);
  Camera& camera = picture.view.camera;
  camera.width = camera.height = side;
  camera.fx = camera.fy = distance / picture.pixel;
  camera.cx = camera.cy = side / 2.0;
  Pose& pose = picture.view.cam_from_world;
  pose.rotation = Eigen::Quaterniond::FromTwoVectors(-plane.normal, Eigen::Vector3d::UnitZ());
  pose.translation = -(pose.rotation * (plane.point + distance * plane.normal));
  return picture;
}

// What a picture of a plane shows.
struct PlaneLook {
  Image color;
  std::vector<float> alpha;  // [pixels]
};
absl::StatusOr<PlaneLook> LookAtPlane(const Segmenter& segmenter, const ModelView& view,
                                      const GaussianSet& slab) {
  PlaneLook look;
  ASSIGN_OR_RETURN(look.color, segmenter.RenderColor(view, &slab));
  ASSIGN_OR_RETURN(const PixelRows rows, RowsOfView(segmenter, view, &slab));
  look.alpha.resize(rows.num_rows());
  for (size_t i = 0; i < look.alpha.size(); ++i) {
    for (int32_t e = rows.first[i]; e < rows.first[i + 1]; ++e) look.alpha[i] += rows.weight[e];
  }
  return look;
}

// Returns the pixels inside the outline of the thing on the plane, and a margin: [height, width].
std::vector<uint8_t> FootOf(const PlanePicture& picture, const SupportPlane& plane,
                            std::span<const Eigen::Vector3d> thing) {
  std::vector<Eigen::Vector2d> outline;
  for (const Eigen::Vector3d& p : thing) {
    const Eigen::Vector3d on_plane = p - plane.Above(p) * plane.normal;
    if ((on_plane - plane.point).norm() > kPictureReach * picture.reach) continue;
    if (const auto at = PixelOf(picture.view, on_plane)) outline.push_back(*at);
  }
  outline = HullOf(std::move(outline));
  const double margin = std::max(2.0, kOutlineMargin * picture.reach / picture.pixel);
  const Camera& camera = picture.view.camera;
  std::vector<uint8_t> foot;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      foot.push_back(IsInside(outline, {x + 0.5, y + 0.5}, margin) ? 1 : 0);
    }
  }
  return foot;
}

// Returns the Gaussians of the slab that are in the shadow.
std::vector<PlaneFill::Lit> LitBy(const CastShadow& shadow, const PlanePicture& picture,
                                  const Gaussians& gaussians, const GaussianSet& slab) {
  const Camera& camera = picture.view.camera;
  std::vector<PlaneFill::Lit> lit;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    if (slab.member[i] == 0) continue;
    const std::optional<Eigen::Vector2d> at = PixelOf(picture.view, MeanOf(gaussians, i));
    if (!at || !IsInView(picture.view, *at)) continue;
    const size_t pixel = static_cast<size_t>(at->y()) * camera.width + static_cast<size_t>(at->x());
    if (shadow.share[pixel] > 0) lit.push_back({i, shadow.GainAt(pixel)});
  }
  return lit;
}

}  // namespace

NewGaussians GaussiansOf(std::span<const Patch> patches, int sh_degree,
                         const NearestPoints& nearest, std::span<const int64_t> rows) {
  NewGaussians added;
  added.gaussians = Gaussians::Zero(static_cast<int64_t>(patches.size()), sh_degree);
  for (size_t i = 0; i < patches.size(); ++i) {
    const Patch& patch = patches[i];
    const auto set = [&](int plane, double value) {
      added.gaussians.Plane(plane)[i] = static_cast<float>(value);
    };
    const Eigen::Quaterniond q =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), patch.normal);
    set(kRotationPlane, q.w());
    for (int k = 0; k < 3; ++k) {
      set(kMeanPlane + k, patch.mean[k]);
      set(kLogScalePlane + k, std::log(patch.size * (k == 2 ? kThickness : 1)));
      set(kRotationPlane + 1 + k, q.vec()[k]);
      set(kShPlane + k, (patch.color[k] - 0.5) / kSh0);
    }
    set(kOpacityPlane, std::log(kOpacity / (1 - kOpacity)));
    added.like.push_back(rows[nearest.Find(patch.mean).index]);
  }
  return added;
}

absl::StatusOr<PlaneFill> FillPlane(const Segmenter& segmenter, const SupportPlane& plane,
                                    const GaussianSet& rest, std::span<const int64_t> thing) {
  const Model& model = segmenter.model();
  const std::vector<Eigen::Vector3d> points = MeansOf(model.gaussians, thing);
  const PlanePicture picture = PictureOf(plane, points, model.scene_radius);
  GaussianSet slab = rest;
  for (int64_t i = 0; i < model.gaussians.count; ++i) {
    const double above = plane.Above(MeanOf(model.gaussians, i));
    if (std::abs(above) > kSlabTolerances * plane.tolerance) slab.member[i] = 0;
  }
  ASSIGN_OR_RETURN(const PlaneLook look, LookAtPlane(segmenter, picture.view, slab));
  const std::vector<uint8_t> foot = FootOf(picture, plane, points);
  HolePicture hole{picture.view.camera.width, picture.view.camera.height, {}, {}, {}};
  hole.known.resize(look.alpha.size());
  hole.hole.resize(look.alpha.size());
  hole.values = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(look.alpha.size()), 3);
  for (size_t i = 0; i < look.alpha.size(); ++i) {
    if (look.alpha[i] >= kKnownAlpha) {
      hole.known[i] = 1;
      hole.values.row(static_cast<Eigen::Index>(i)) = ColorAt(look.color, i) / look.alpha[i];
    } else {
      hole.hole[i] = foot[i];
    }
  }
  PlaneFill fill;
  const CastShadow shadow = FindShadow(hole, foot);
  if (!shadow.share.empty()) {
    for (size_t i = 0; i < hole.num_pixels(); ++i) {
      hole.values.row(static_cast<Eigen::Index>(i)).array() *= shadow.GainAt(i).transpose();
    }
    fill.lit = LitBy(shadow, picture, model.gaussians, slab);
  }
  if (KeepEnclosed(kMinKnown, hole) == 0) return fill;
  FillSmoothly(hole);
  for (int y = 0; y < hole.height; ++y) {
    for (int x = 0; x < hole.width; ++x) {
      const Eigen::Index i = Eigen::Index{y} * hole.width + x;
      if (hole.hole[i] == 0) continue;
      fill.patches.push_back({picture.PointAt(plane, x, y), plane.normal,
                              kSizeInPixels * picture.pixel, hole.values.row(i)});
    }
  }
  return fill;
}

std::vector<uint8_t> OpenPixels(const ModelView& view, const ThingLook& look,
                                std::span<const Patch> patches) {
  const Camera& camera = view.camera;
  std::vector<uint8_t> open(look.changed.size());
  for (size_t i = 0; i < open.size(); ++i) {
    open[i] = look.changed[i] != 0 && look.depth[i] == 0 ? uint8_t{1} : uint8_t{0};
  }
  for (const Patch& patch : patches) {
    const Eigen::Vector3d p = view.cam_from_world * patch.mean;
    if (p.z() <= 0) continue;
    const double x = camera.fx * p.x() / p.z() + camera.cx;
    const double y = camera.fy * p.y() / p.z() + camera.cy;
    const double radius = std::max(1.0, 2 * patch.size * camera.fx / p.z());
    // Next to the camera's plane, pixels exceed an int.
    const auto first = [](double at, int size) {
      return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(size)));
    };
    const auto last = [](double at, int size) {
      return static_cast<int>(std::clamp(at, -1.0, size - 1.0));
    };
    for (int v = first(y - radius, camera.height); v <= last(y + radius, camera.height); ++v) {
      for (int u = first(x - radius, camera.width); u <= last(x + radius, camera.width); ++u) {
        open[static_cast<size_t>(v) * camera.width + u] = 0;
      }
    }
  }
  return open;
}

std::vector<Patch> ViewPatches(const ModelView& view, const ThingLook& look,
                               std::vector<uint8_t> open, const ThingSpace& space) {
  const Camera& camera = view.camera;
  HolePicture picture{camera.width, camera.height, {}, std::move(open), {}};
  const double nearest =
      (view.cam_from_world * space.center).z() - kFrontRadii * space.radius;  // of what is behind
  picture.known.resize(look.depth.size());
  picture.values = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(look.depth.size()), 4);
  for (size_t i = 0; i < look.depth.size(); ++i) {
    if (look.depth[i] == 0 || look.depth[i] < nearest) continue;
    picture.known[i] = 1;
    picture.values.row(static_cast<Eigen::Index>(i)) << ColorAt(look.color, i).transpose(),
        1 / look.depth[i];
  }
  std::vector<Patch> patches;
  if (KeepEnclosed(kMinKnown, picture) == 0) return patches;
  FillSmoothly(picture);
  const Pose world_from_cam = view.cam_from_world.Inverse();
  const auto point_at = [&](int x, int y) -> Eigen::Vector3d {
    const double depth = 1 / picture.values(Eigen::Index{y} * camera.width + x, 3);
    return depth *
           Eigen::Vector3d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1);
  };
  for (int y = 0; y + 1 < camera.height; y += kStride) {
    for (int x = 0; x + 1 < camera.width; x += kStride) {
      const Eigen::Index i = Eigen::Index{y} * camera.width + x;
      if (picture.hole[i] == 0) continue;
      const Eigen::Vector3d p = point_at(x, y);
      Eigen::Vector3d normal = -p.normalized();  // to the camera where the neighbours are no hole
      if (picture.hole[i + 1] != 0 && picture.hole[i + camera.width] != 0) {
        normal = (point_at(x, y + 1) - p).cross(point_at(x + 1, y) - p).normalized();
      }
      patches.push_back({world_from_cam * p, world_from_cam.rotation * normal,
                         kSizeInPixels * kStride * p.z() / camera.fx,
                         picture.values.row(i).head(3)});
    }
  }
  return patches;
}

}  // namespace pepeseg
