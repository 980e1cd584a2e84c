#include "core/reconstruct/preparation.h"

#include "core/reconstruct/blurred_views.h"
#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/pixel_budget.h"
#include "core/reconstruct/scene_needs.h"

namespace pepeseg {
namespace {

constexpr double kNearPlane = 0.01;  // scene radii

}  // namespace

PreparedScene::PreparedScene(Backend& backend, const Capture& capture,
                             const ReconstructOptions& given, std::mt19937_64& random)
    : options(WithPixelBudget(WithDepthWeight(given, capture), capture)),
      skipped(SkippedParts(given, capture)),
      radius(SceneRadius(capture)),
      near_plane(static_cast<float>(kNearPlane * radius)),
      points(StartingPoints(capture, options, random)),
      log_scales(BoundLogScales(capture, points)),
      schedule(options, radius, PixelSpan(capture, points)),
      free_space(capture, options.camera_clearance),
      views(
          backend, capture,
          {options.coarse_until > 0, options.depth_weight > 0, options.disparity_as_inverse_depth}),
      blurred(options.blurred_share < 1 ? FindBlurred(capture) : std::vector<bool>()) {}

}  // namespace pepeseg
