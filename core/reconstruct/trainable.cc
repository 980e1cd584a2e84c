#include "core/reconstruct/trainable.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "absl/strings/str_cat.h"

namespace pepeseg {

// Checks only training views: held-out views are not uploaded.
absl::Status CheckTrainable(const Capture& capture) {
  int num_training = 0;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    const size_t num_pixels = static_cast<size_t>(view.camera.width) * view.camera.height;
    if (num_pixels == 0 || view.photo.pixels.size() != 3 * num_pixels) {
      return absl::FailedPreconditionError(absl::StrCat(
          "view ", view.name, ": the photograph has ", view.photo.pixels.size(),
          " bytes, its camera needs ", view.camera.width, " x ", view.camera.height, " x 3"));
    }
    if (!view.ignore.empty() && view.ignore.size() != num_pixels) {
      return absl::FailedPreconditionError(
          absl::StrCat("view ", view.name, ": the ignore mask has ", view.ignore.size(),
                       " pixels, the photograph ", num_pixels));
    }
    if (!view.depth.values.empty() && view.depth.values.size() != num_pixels) {
      return absl::FailedPreconditionError(
          absl::StrCat("view ", view.name, ": the depth prior has ", view.depth.values.size(),
                       " pixels, the photograph ", num_pixels));
    }
    ++num_training;
  }
  if (num_training > 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("no training view among the ", capture.views.size(), " of the capture"));
}

// The depth loss is skipped for one of three reasons: no prior, priors that are made of the
// starting points, or a weight of 0.
std::vector<SkippedTerm> SkippedTerms(const ReconstructOptions& options, const Capture& capture) {
  std::vector<SkippedTerm> skipped;
  if (options.depth_weight == 0) {
    const char* none = HasTrainingDepth(capture)
                           ? "the depth priors were made from the points that training starts from"
                           : "no training view has a depth prior";
    skipped.push_back({"depth", HasTrainingGeometry(capture) ? "depth_weight is 0" : none});
  }
  const bool has_masks = std::ranges::any_of(
      capture.views, [](const View& view) { return !view.held_out && !view.masks.empty(); });
  if (options.refine_keep == RefineKeep::kNone || !has_masks) {
    skipped.push_back(
        {"refinement", has_masks ? "refine_keep is NONE" : "no training view has masks"});
  }
  return skipped;
}

// A view looks along +z of its camera; the inverse rotation takes that into the world.
double ViewingSpread(const Capture& capture) {
  std::vector<Eigen::Vector3d> directions;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    directions.emplace_back(view.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ());
    sum += directions.back();
  }
  if (directions.empty()) return 0;
  constexpr double kCancelled = 1e-6;  // share of the length that equal directions would have
  const auto num = static_cast<double>(directions.size());
  // Views in opposite directions, as on a full circle, have no mean direction.
  if (sum.norm() < kCancelled * num) return 180;
  const Eigen::Vector3d mean = sum.normalized();
  double squares = 0;
  for (const Eigen::Vector3d& direction : directions) {
    // Rounding can leave the product just outside [-1, 1], where acos is NaN.
    const double angle = std::acos(std::clamp(direction.dot(mean), -1.0, 1.0));
    squares += angle * angle / num;
  }
  return std::sqrt(squares) * 180 / std::numbers::pi;
}

CaptureKind FindCaptureKind(const Capture& capture) {
  return ViewingSpread(capture) < kForwardFacingSpread ? CaptureKind::kForwardFacing
                                                       : CaptureKind::kOrbit;
}

}  // namespace pepeseg
