#include "core/reconstruct/training_views.h"

#include <algorithm>

#include "core/reconstruct/depth_prior.h"
#include "core/render/pinhole_view.h"

namespace pepeseg {
namespace {

// Returns the photograph at 1 / `factor` of its size, averaged over blocks; cropped to whole ones.
std::vector<uint8_t> ShrinkPhoto(const Image& photo, int factor) {
  const int width = photo.width / factor, height = photo.height / factor;
  const int area = factor * factor;
  std::vector<uint8_t> small(static_cast<size_t>(3) * width * height);
  for (int64_t i = 0; i < static_cast<int64_t>(small.size()); ++i) {
    const int64_t channel = i % 3, x = i / 3 % width, y = i / 3 / width;
    int sum = area / 2;  // rounds to nearest
    for (int k = 0; k < area; ++k) {
      const int64_t row = y * factor + k / factor, column = x * factor + k % factor;
      sum += photo.pixels[(row * photo.width + column) * 3 + channel];
    }
    small[i] = static_cast<uint8_t>(sum / area);
  }
  return small;
}

// Returns the ignore mask at 1 / `factor` of its size: a block with an ignored pixel is ignored.
std::vector<uint8_t> ShrinkIgnore(const View& view, int factor) {
  if (view.ignore.empty()) return {};
  const int width = view.camera.width / factor, height = view.camera.height / factor;
  std::vector<uint8_t> small(static_cast<size_t>(width) * height, 0);
  for (int y = 0; y < height * factor; ++y) {
    for (int x = 0; x < width * factor; ++x) {
      small[static_cast<size_t>(y / factor) * width + x / factor] |=
          view.ignore[static_cast<size_t>(y) * view.camera.width + x];
    }
  }
  return small;
}

// Returns an empty buffer when the backend is out of memory; TrainingViews::allocated() reports it.
template <class T>
Buffer<T> UploadOrNothing(Backend& backend, const std::vector<T>& values) {
  Buffer<T> buffer(backend, static_cast<int64_t>(values.size()));
  if (buffer.size() == static_cast<int64_t>(values.size())) buffer.Upload(values);
  return buffer;
}

TrainingView Upload(Backend& backend, const View& view, int factor) {
  const std::vector<uint8_t> photo =
      factor == 1 ? view.photo.pixels : ShrinkPhoto(view.photo, factor);
  TrainingView out;
  out.pinhole = Shrink(ToPinholeView(view.camera, view.cam_from_world), factor);
  out.photo = UploadOrNothing(backend, photo);
  out.ignore = UploadOrNothing(backend, ShrinkIgnore(view, factor));
  return out;
}

// Bounds and deviation are those of the full size at all sizes.
void UploadPrior(Backend& backend, const View& view, int factor, TrainingView& out) {
  out.prior = UploadOrNothing(backend, ShrinkPrior(view, factor));
  const PriorBounds bounds = InlierBounds(view.depth.values);
  out.min_prior = bounds.min;
  out.max_prior = bounds.max;
  out.prior_deviation = MeanDeviation(view.depth.values, bounds);
  out.inverse_depth = view.depth.kind == DepthPrior::Kind::kDisparity;
}

}  // namespace

// Uploads each training view at 1, 1/2 and 1/4 of its size, or at full size only. The same buffers
// serve all steps: photographs are never uploaded twice.
TrainingViews::TrainingViews(Backend& backend, const Capture& capture,
                             const TrainingViewsOptions& options) {
  for (const View& view : capture.views) {
    if (view.held_out) continue;
    const bool with_prior = options.with_depth && HasGeometryPrior(view);
    auto& sizes = views_.emplace_back();
    for (int size = 0; size < (options.coarse ? kNumSizes : 1); ++size) {
      sizes[size] = Upload(backend, view, 1 << size);
      if (with_prior) UploadPrior(backend, view, 1 << size, sizes[size]);
      const PinholeView& pinhole = sizes[size].pinhole;
      const int64_t num_pixels = static_cast<int64_t>(pinhole.width) * pinhole.height;
      if (size == 0) num_pixels_ += num_pixels;
      max_pixels_ = std::max(max_pixels_, num_pixels);
      allocated_ = allocated_ && sizes[size].photo.size() == 3 * num_pixels &&
                   (view.ignore.empty() || sizes[size].ignore.size() == num_pixels) &&
                   (!with_prior || sizes[size].prior.size() == num_pixels);
    }
  }
}

}  // namespace pepeseg
