#include "core/train/previews.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "core/scene/camera.h"

namespace pepeseg {
namespace {

constexpr double kMinInterval = 2;  // seconds
constexpr double kGrowth = 1.1;     // of the time since the stage's start
constexpr int kQualities[] = {85, 70, 50, 30};

Eigen::Vector3d CenterOfCamera(const View& view) {
  return view.cam_from_world.Inverse().translation;
}

}  // namespace

void PreviewSchedule::Record(double start, double end) {
  next_ = std::max({start + kMinInterval, start * kGrowth, end + (end - start) / max_cost_});
}

size_t PreviewView(const Capture& capture) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  int num_training = 0;
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    mean += CenterOfCamera(view);
    ++num_training;
  }
  mean /= std::max(1, num_training);
  size_t nearest = 0;
  double least = -1;
  for (size_t i = 0; i < capture.views.size(); ++i) {
    if (capture.views[i].held_out) continue;
    const double distance = (CenterOfCamera(capture.views[i]) - mean).norm();
    if (least >= 0 && distance >= least) continue;
    least = distance;
    nearest = i;
  }
  return nearest;
}

Camera PreviewCamera(const Camera& camera) {
  const int longer = std::max(camera.width, camera.height);
  if (longer <= kMaxPreviewSide) return camera;
  const double scale = static_cast<double>(kMaxPreviewSide) / longer;
  const auto shrunk = [&](int side) {
    return std::clamp(static_cast<int>(std::lround(side * scale)), 1, kMaxPreviewSide);
  };
  return Resized(camera, shrunk(camera.width), shrunk(camera.height));
}

absl::StatusOr<std::string> EncodePreview(Image& image) {
  while (true) {
    for (const int quality : kQualities) {
      ASSIGN_OR_RETURN(std::string jpeg, EncodeJpeg(image, quality));
      if (jpeg.size() <= kMaxPreviewBytes) return jpeg;
    }
    const int longer = std::max(image.width, image.height);
    image = ShrunkTo(std::move(image), longer * 3 / 4);
  }
}

Previews::Previews(const Capture& capture, GaussianTrainer& trainer, TrainingObserver& observer)
    : view_(capture.views[PreviewView(capture)]), trainer_(trainer), observer_(observer) {}

absl::Status Previews::ShowIfDue(const StepReport& report) {
  if (!observer_.WantsPreviews()) return absl::OkStatus();
  const double start = Seconds();
  if (!schedule_.Due(start) && !trainer_.done()) return absl::OkStatus();
  RETURN_IF_ERROR(Show(report));
  schedule_.Record(start, Seconds());
  return absl::OkStatus();
}

absl::Status Previews::Show(const StepReport& report) {
  absl::StatusOr<Image> image =
      trainer_.Render(ToPinholeView(PreviewCamera(view_.camera), view_.cam_from_world));
  if (absl::IsResourceExhausted(image.status())) return absl::OkStatus();
  RETURN_IF_ERROR(image.status());
  Preview preview = {.step = report.step, .num_steps = report.num_steps, .view = view_.name};
  ASSIGN_OR_RETURN(preview.jpeg, EncodePreview(*image));
  preview.width = image->width;
  preview.height = image->height;
  return observer_.ShowPreview(preview);
}

}  // namespace pepeseg
