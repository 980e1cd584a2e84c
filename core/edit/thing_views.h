#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "core/scene/model.h"

namespace pepeseg {

// Longest side of a ThingView, pixels.
inline constexpr int kThingViewSide = 384;
// Most views of a thing that are looked at.
inline constexpr size_t kMaxThingViews = 32;

// Returns the means of some Gaussians, in their order.
std::vector<Eigen::Vector3d> MeansOf(const Gaussians& gaussians, std::span<const int64_t> rows);

// Returns where a view shows a point, in its pixels, which may be outside of it. Absent: the point
// is not in front of the camera.
std::optional<Eigen::Vector2d> PixelOf(const ModelView& view, const Eigen::Vector3d& point);
// Returns whether a position is in the view.
bool IsInView(const ModelView& view, const Eigen::Vector2d& pixel);
// Returns the blend rows of all pixels of a view, see Segmenter::Rows.
absl::StatusOr<PixelRows> RowsOfView(const Segmenter& segmenter, const ModelView& view,
                                     const GaussianSet* subset);

// Where a thing is in space.
struct ThingSpace {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius = 0;  // of a ball around the center with nearly all of its Gaussians; scene units
};
ThingSpace SpaceOf(const Gaussians& gaussians, std::span<const int64_t> thing);

// Returns the parts of the model's training views around a thing, with a margin, shrunk to
// kThingViewSide. Views that hardly see the thing are left out; of more than kMaxThingViews some
// are taken, spread evenly.
std::vector<ModelView> ThingViews(const Model& model, std::span<const int64_t> thing);

// What a view shows with the thing and without it.
struct ThingLook {
  std::vector<uint8_t> changed;  // [height, width] 0 or 1: removing the thing changes the pixel
  // [height, width] depth without the thing, scene units; 0: alpha is at most a half there.
  std::vector<float> depth;
  Image color;  // without the thing
};
// rest: all Gaussians but the thing. Errors are those of Segmenter::RenderColor.
absl::StatusOr<ThingLook> LookWithout(const Segmenter& segmenter, const ModelView& view,
                                      const GaussianSet& rest);

}  // namespace pepeseg
