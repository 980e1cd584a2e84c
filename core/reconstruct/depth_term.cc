#include "core/reconstruct/depth_term.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace pepeseg {
namespace {

constexpr float kOrbitWeight = 0.05f, kForwardFacingWeight = 0.1f;    // default depth_weight
constexpr double kSmallestPatch = 1.0 / 16, kLargestPatch = 1.0 / 3;  // sides, share of the width

}  // namespace

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

// Priors that are made of the capture's points do not count: the Gaussians start from the same
// points, so that such a prior adds nothing.
ReconstructOptions WithDepthWeight(ReconstructOptions options, const Capture& capture) {
  if (options.capture_kind == CaptureKind::kAutomatic) {
    options.capture_kind = FindCaptureKind(capture);
  }
  if (!HasTrainingGeometry(capture)) {
    options.depth_weight = 0;
  } else if (options.depth_weight < 0) {
    options.depth_weight =
        options.capture_kind == CaptureKind::kOrbit ? kOrbitWeight : kForwardFacingWeight;
  }
  return options;
}

DepthTerm::DepthTerm(Backend& backend, const ReconstructOptions& options, int64_t max_pixels)
    : backend_(backend),
      options_(options),
      // Rendered alpha and depth, and their two gradients: see ImagesFor.
      images_(backend, options.depth_weight > 0 ? 4 * max_pixels : 0) {
  if (options.depth_weight <= 0 || options.depth_over_alpha) return;
  const std::vector<float> ones(static_cast<size_t>(max_pixels), 1.0f);
  ones_ = Buffer<float>(backend, std::span<const float>(ones));
}

void DepthTerm::LeaveOut() {
  left_out_ = true;
  images_ = {};
  ones_ = {};
}

// Draws from `random` only for DepthLocalForm::kPatch.
DepthPlan DepthTerm::PlanFor(const TrainingView& view, float weight,
                             std::mt19937_64& random) const {
  if (view.prior.empty() || !InEffect(weight)) return {};
  DepthPlan plan = {weight, {}};
  if (options_.depth_local_form == DepthLocalForm::kPatch) {
    plan.patch = DrawPatch(view.pinhole, random);
  }
  return plan;
}

// Returns a random rectangle of about the size of a mask. Width and height are drawn independently,
// log-uniform in [1/16, 1/3] of the view's width and limited by the view.
PixelBox DepthTerm::DrawPatch(const PinholeView& view, std::mt19937_64& random) const {
  // Four draws in a fixed order: width, height, x, y.
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto side = [&](int most) {
    const double share = kSmallestPatch * std::pow(kLargestPatch / kSmallestPatch, uniform(random));
    return std::clamp(static_cast<int>(std::lround(share * view.width)), 1, most);
  };
  PixelBox patch;
  patch.width = side(view.width);
  patch.height = side(view.height);
  patch.x = static_cast<int>(uniform(random) * (view.width - patch.width + 1));
  patch.y = static_cast<int>(uniform(random) * (view.height - patch.height + 1));
  return patch;
}

DepthImages DepthTerm::ImagesFor(const TrainingView& view, const DepthPlan& plan) {
  if (plan.weight == 0) return {};
  const int64_t size = int64_t{view.pinhole.width} * view.pinhole.height;
  const auto image = [&](int k) { return images_.span().Subspan(k * size, size); };
  return {view.inverse_depth, image(0), image(1), image(2), image(3)};
}

// L_global has the weight of the plan, L_local that times depth_local_weight. The op fits scale and
// shift in closed form; no gradient passes through the fit. The plain alpha blend is what the op
// makes of an alpha of 1, without a gradient of alpha.
void DepthTerm::Compare(const TrainingView& view, const DepthPlan& plan, DeviceSpan<double> sums) {
  if (plan.weight == 0) return;
  const DepthImages images = ImagesFor(view, plan);
  const bool plain = !options_.depth_over_alpha;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const long radius = std::lround(options_.depth_window * static_cast<float>(view.pinhole.width));
  backend_.DepthLoss({.width = view.pinhole.width,
                      .height = view.pinhole.height,
                      .alpha = plain ? ones_.span().Subspan(0, images.alpha.size) : images.alpha,
                      .depth = images.depth,
                      .prior = view.prior.span(),
                      .ignore = view.ignore.span(),
                      .min_prior = plain ? -kInfinity : view.min_prior,
                      .max_prior = plain ? kInfinity : view.max_prior,
                      .view_weight = plan.weight,
                      .local_weight = plan.weight * options_.depth_local_weight,
                      .local_form = options_.depth_local_form,
                      .window_radius = std::max(1, static_cast<int>(radius)),
                      .patch = plan.patch,
                      .alpha_grad = images.alpha_grad,
                      .depth_grad = images.depth_grad,
                      .sums = sums});
  if (plain) backend_.Zero(images.alpha_grad.data, images.alpha_grad.size * sizeof(float));
}

}  // namespace pepeseg
