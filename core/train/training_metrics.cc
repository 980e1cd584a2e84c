#include "core/train/training_metrics.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

using Metrics = TrainingMetrics;

constexpr std::pair<const char*, Metrics::Number Metrics::*> kNumbers[] = {
    {"num_photographs", &Metrics::num_photographs},
    {"num_views", &Metrics::num_views},
    {"num_points", &Metrics::num_points},
    {"num_masks", &Metrics::num_masks},
    {"num_depth_maps", &Metrics::num_depth_maps},
    {"num_registered", &Metrics::num_registered},
    {"reprojection_error", &Metrics::reprojection_error},
    {"num_gaussians", &Metrics::num_gaussians},
    {"psnr", &Metrics::psnr},
    {"ssim", &Metrics::ssim},
    {"lpips", &Metrics::lpips},
    {"mask_quality", &Metrics::mask_quality},
    {"resumed_from_step", &Metrics::resumed_from_step},
    {"features_resumed_from_step", &Metrics::features_resumed_from_step},
    {"peak_device_bytes", &Metrics::peak_device_bytes},
    {"peak_memory_bytes", &Metrics::peak_memory_bytes}};

}  // namespace

void TrainingMetrics::Merge(const TrainingMetrics& other) {
  const auto take = [](const Number& from, Number& to) {
    if (from) to = from;
  };
  for (const auto& [name, number] : kNumbers) take(other.*number, this->*number);
  for (size_t i = 0; i < seconds.size(); ++i) {
    take(other.seconds[i], seconds[i]);
    take(other.core_seconds[i], core_seconds[i]);
  }
}

std::map<std::string, double> TrainingMetrics::ByName() const {
  std::map<std::string, double> named;
  const auto add = [&named](const std::string& name, const Number& number) {
    if (number) named[name] = *number;
  };
  for (const auto& [name, number] : kNumbers) add(name, this->*number);
  for (int i = 0; i < kNumStages; ++i) {
    const char* stage = NameOf(static_cast<Stage>(i));
    add(absl::StrCat("seconds_", stage), seconds[i]);
    add(absl::StrCat("core_seconds_", stage), core_seconds[i]);
  }
  return named;
}

TrainingMetrics MeansOf(std::span<const ViewScores> scores) {
  if (scores.empty()) return {};
  const ImageScores mean = Mean(scores);
  return {.psnr = mean.psnr, .ssim = mean.ssim, .lpips = mean.lpips};
}

TrainingMetrics Counts(const Capture& capture) {
  double num_masks = 0, num_depth_maps = 0;
  for (const View& view : capture.views) {
    num_masks += view.masks.num_masks;
    num_depth_maps += view.depth.values.empty() ? 0 : 1;
  }
  return {.num_views = static_cast<double>(capture.views.size()),
          .num_points = static_cast<double>(capture.points.size()),
          .num_masks = num_masks,
          .num_depth_maps = num_depth_maps};
}

}  // namespace pepeseg
