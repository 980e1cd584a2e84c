#include "core/reconstruct/preparation.h"

#include "absl/strings/str_cat.h"
#include "core/reconstruct/blurred_views.h"
#include "core/reconstruct/depth_term.h"
#include "core/reconstruct/estimate.h"
#include "core/reconstruct/few_visits.h"
#include "core/reconstruct/scene_needs.h"

namespace pepeseg {
namespace {

constexpr double kNearPlane = 0.01;  // scene radii

ReconstructOptions OptionsFor(const Capture& capture, const ReconstructOptions& given) {
  return FitToViews(WithDepthWeight(given, capture), TrainingViewPixels(capture));
}

std::vector<SkippedPart> SkippedParts(const ReconstructOptions& given,
                                      const ReconstructOptions& options, const Capture& capture) {
  std::vector<SkippedPart> skipped = SkippedParts(given, capture);
  if (const int saved = given.num_steps - options.num_steps; saved > 0) {
    skipped.push_back({Part::kSteps,
                       absl::StrCat("on ", capture.views.size(), " large photographs ",
                                    options.num_steps, " steps suffice with raised rates"),
                       0, saved});
  }
  return skipped;
}

}  // namespace

PreparedScene::PreparedScene(Backend& backend, const Capture& capture,
                             const ReconstructOptions& given, std::mt19937_64& random)
    : options(OptionsFor(capture, given)),
      skipped(SkippedParts(given, options, capture)),
      radius(SceneRadius(capture)),
      near_plane(static_cast<float>(kNearPlane * radius)),
      points(StartingPoints(capture, options, random)),
      log_scales(BoundLogScales(capture, points)),
      schedule(options, radius, PixelSpan(capture, points)),
      free_space(capture, options.camera_clearance),
      place(PhotographPlace(backend, SizeOf(capture), options)),
      views(backend, capture,
            {options.coarse_until > 0, options.depth_weight > 0, options.disparity_as_inverse_depth,
             place}),
      blurred(options.blurred_share < 1 ? FindBlurred(capture) : std::vector<bool>()) {}

}  // namespace pepeseg
