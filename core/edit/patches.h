#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/edit/edited_model.h"
#include "core/edit/nearest_points.h"
#include "core/edit/support_planes.h"
#include "core/edit/thing_views.h"
#include "core/query/segmenter.h"

// The hole behind a thing that was removed, filled with flat Gaussians.

namespace pepeseg {

// A flat, round Gaussian that continues a surface.
struct Patch {
  Eigen::Vector3d mean, normal;  // scene units; of length 1
  double size = 0;               // standard deviation, scene units
  Eigen::Vector3d color;         // R, G, B in [0, 1]
};

// Returns the patches as Gaussians whose colour is the same from all sides. Each is like the
// Gaussian of `rows` whose mean, in `nearest`, is the nearest.
NewGaussians GaussiansOf(std::span<const Patch> patches, int sh_degree,
                         const NearestPoints& nearest, std::span<const int64_t> rows);

// What becomes of a plane without the thing.
struct PlaneFill {
  std::vector<Patch> patches;  // where it was not seen
  // Gaussians that were in the thing's shadow, and the factors on their colours.
  struct Lit {
    int64_t row;
    Eigen::Array3d factor;
  };
  std::vector<Lit> lit;
};
// Continues a plane under the thing, where none of the Gaussians of `rest` cover it: in a picture
// of the plane, seen from the thing's side, with the colours of what is around the hole. Lights
// what is in the thing's shadow (FindShadow).
absl::StatusOr<PlaneFill> FillPlane(const Segmenter& segmenter, const SupportPlane& plane,
                                    const GaussianSet& rest, std::span<const int64_t> thing);

// The pixels of a view that show nothing without the thing, and that no patch covers.
std::vector<uint8_t> OpenPixels(const ModelView& view, const ThingLook& look,
                                std::span<const Patch> patches);

// Continues depth and colours of a view into these pixels. Returns nothing where what is around
// them is not known, such as in front of the sky.
std::vector<Patch> ViewPatches(const ModelView& view, const ThingLook& look,
                               std::vector<uint8_t> open, const ThingSpace& space);

}  // namespace pepeseg
