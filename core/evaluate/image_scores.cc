#include "core/evaluate/image_scores.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/render/renderer.h"

namespace pepeseg {
namespace {

constexpr double kMinMse = 1e-10;  // caps the PSNR of equal images at 100 dB

absl::Status CheckView(const View& view) {
  const size_t num_pixels = static_cast<size_t>(view.camera.width) * view.camera.height;
  if (view.photo.pixels.size() != 3 * num_pixels) {
    return absl::FailedPreconditionError(
        absl::StrCat("view ", view.name, ": the photograph is not of its camera's size"));
  }
  if (!view.ignore.empty() && view.ignore.size() != num_pixels) {
    return absl::FailedPreconditionError(
        absl::StrCat("view ", view.name, ": the ignore mask is not of the photograph's size"));
  }
  return absl::OkStatus();
}

// Downloads a rendering's planes [3, height, width] as interleaved pixels in [0, 1]. Ignored pixels
// get the photograph's values, so that they contribute no perceptual distance.
std::vector<float> Interleaved(Backend& backend, DeviceSpan<const float> color, const View& view) {
  const size_t num_pixels = view.photo.pixels.size() / 3;
  std::vector<float> planes(3 * num_pixels), pixels(3 * num_pixels);
  backend.CopyToHost(planes.data(), color.data, planes.size() * sizeof(float));
  for (size_t i = 0; i < pixels.size(); ++i) {
    const bool ignored = !view.ignore.empty() && view.ignore[i / 3] != 0;
    pixels[i] = ignored ? static_cast<float>(view.photo.pixels[i]) / 255
                        : std::clamp(planes[i % 3 * num_pixels + i / 3], 0.0f, 1.0f);
  }
  return pixels;
}

// Renders and scores one view after another; scene and scratch buffers stay on the device in
// between.
class ViewScorer {
 public:
  ViewScorer(Backend& backend, const Gaussians& gaussians, double scene_radius)
      : backend_(backend),
        renderer_(backend, gaussians, scene_radius),
        sums_(backend, kNumImageLossSums) {}

  absl::StatusOr<ImageScores> Score(const View& view, const PerceptualDistance& lpips) {
    RETURN_IF_ERROR(CheckView(view));
    const int width = view.camera.width, height = view.camera.height;
    const Buffer<uint8_t> photo(backend_, std::span<const uint8_t>(view.photo.pixels));
    const Buffer<uint8_t> ignore(backend_, std::span<const uint8_t>(view.ignore));
    const DeviceSpan<const float> color = renderer_.ColorPlanes(view);
    backend_.ImageLoss({.width = width,
                        .height = height,
                        .color = color,
                        .target = photo.span(),
                        .ignore = ignore.span(),
                        .sums = sums_.span()});
    double sums[kNumImageLossSums];
    sums_.Download(sums);
    if (const std::string error = backend_.error(); !error.empty()) {
      return absl::InternalError(absl::StrCat("view ", view.name, ": ", error));
    }
    if (sums[kSumPixelChannels] == 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("view ", view.name, ": the ignore mask leaves no pixel to score"));
    }
    const double mse = std::max(kMinMse, sums[kSumSquared] / sums[kSumPixelChannels]);
    ImageScores scores{-10 * std::log10(mse), sums[kSumSsim] / sums[kSumPixelChannels], {}};
    if (lpips) scores.lpips = lpips(view.photo, Interleaved(backend_, color, view));
    return scores;
  }

 private:
  Backend& backend_;
  Renderer renderer_;
  Buffer<double> sums_;
};

}  // namespace

absl::StatusOr<std::vector<ViewScores>> ScoreHeldOut(Backend& backend, const Capture& capture,
                                                     const Gaussians& gaussians,
                                                     const PerceptualDistance& lpips) {
  ViewScorer scorer(backend, gaussians, SceneRadius(capture));
  std::vector<ViewScores> scores;
  for (const View& view : capture.views) {
    if (!view.held_out) continue;
    ASSIGN_OR_RETURN(const ImageScores score, scorer.Score(view, lpips));
    scores.push_back({view.name, score});
  }
  return scores;
}

ImageScores Mean(std::span<const ViewScores> scores) {
  ImageScores mean;
  double lpips = 0, num_lpips = 0;
  for (const ViewScores& view : scores) {
    mean.psnr += view.scores.psnr;
    mean.ssim += view.scores.ssim;
    lpips += view.scores.lpips.value_or(0);
    num_lpips += view.scores.lpips ? 1 : 0;
  }
  const auto count = static_cast<double>(std::max<size_t>(1, scores.size()));
  mean.psnr /= count;
  mean.ssim /= count;
  if (num_lpips > 0) mean.lpips = lpips / num_lpips;
  return mean;
}

void RecordScores(std::span<const ViewScores> scores, Model& model) {
  std::map<std::string, const ImageScores*> by_view;
  for (const ViewScores& view : scores) by_view[view.view] = &view.scores;
  for (ModelView& view : model.views) {
    if (const auto found = by_view.find(view.name); found != by_view.end()) {
      view.scores = *found->second;
    }
  }
}

}  // namespace pepeseg
