#include "core/reconstruct/training_views.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <span>

#include "absl/strings/str_cat.h"
#include "core/base/on_threads.h"
#include "core/base/order_statistics.h"
#include "core/scene/camera.h"

namespace pepeseg {
namespace {

// Returns the view at 1 / `factor` of its size, cropped to whole blocks of pixels.
PinholeView Shrink(PinholeView view, int factor) {
  const auto f = static_cast<float>(factor);
  view.width /= factor;
  view.height /= factor;
  view.fx /= f, view.fy /= f, view.cx /= f, view.cy /= f;
  return view;
}

// Returns the photograph at 1 / `factor` of its size, averaged over blocks; cropped to whole ones.
std::vector<uint8_t> ShrinkPhoto(const Image& photo, int factor) {
  const int width = photo.width / factor, height = photo.height / factor;
  const auto area = static_cast<uint16_t>(factor * factor);
  std::vector<uint8_t> small(static_cast<size_t>(3) * width * height);
  std::vector<uint16_t> sums(static_cast<size_t>(3) * width);
  for (int y = 0; y < height; ++y) {
    std::ranges::fill(sums, static_cast<uint16_t>(area / 2));  // rounds to nearest
    for (int k = 0; k < factor; ++k) {
      const uint8_t* pixel =
          photo.pixels.data() + static_cast<size_t>(3) * photo.width * (y * factor + k);
      for (int x = 0; x < width; ++x) {
        for (int j = 0; j < factor; ++j, pixel += 3) {
          for (int c = 0; c < 3; ++c) sums[3 * x + c] += pixel[c];
        }
      }
    }
    uint8_t* row = small.data() + static_cast<size_t>(3) * width * y;
    for (size_t i = 0; i < sums.size(); ++i) row[i] = static_cast<uint8_t>(sums[i] / area);
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

// Returns the view's prior at 1 / `factor` of its size: the mean of the known pixels of each block,
// NaN where a block has none. Cropped to whole blocks.
std::vector<float> ShrinkPrior(const View& view, int factor) {
  if (factor == 1) return view.depth.values;
  const int width = view.camera.width / factor, height = view.camera.height / factor;
  const auto size = static_cast<size_t>(width) * height;
  std::vector<float> sum(size, 0), count(size, 0);
  for (int y = 0; y < height * factor; ++y) {
    for (int x = 0; x < width * factor; ++x) {
      const float value = view.depth.values[static_cast<size_t>(y) * view.camera.width + x];
      if (std::isnan(value)) continue;
      const size_t block = static_cast<size_t>(y / factor) * width + x / factor;
      sum[block] += value;
      ++count[block];
    }
  }
  for (size_t i = 0; i < size; ++i) {
    sum[i] = count[i] > 0 ? sum[i] / count[i] : std::numeric_limits<float>::quiet_NaN();
  }
  return sum;
}

struct PriorBounds {
  float min = 0, max = 0;
};

// Returns the 1st and 99th percentiles of the known values; values outside are taken for errors. At
// least one value must be known.
PriorBounds InlierBounds(std::span<const float> prior) {
  constexpr double kShare = 0.01;  // of the known values, at either end
  std::vector<float> known;
  std::ranges::copy_if(prior, std::back_inserter(known), [](float v) { return !std::isnan(v); });
  const float min = NearestRank(known, kShare);
  return {min, NearestRank(known, 1 - kShare)};
}

// Returns the mean |value - mean| of the known values within the bounds; 0 without any. Two passes:
// the mean first, then the mean distance from it.
double MeanDeviation(std::span<const float> prior, const PriorBounds& bounds) {
  const auto mean = [&](auto of) {
    double sum = 0, num = 0;
    for (const float value : prior) {
      if (!(value >= bounds.min && value <= bounds.max)) continue;  // NaN: unknown
      sum += of(value);
      ++num;
    }
    return num > 0 ? sum / num : 0.0;
  };
  const double center = mean([](float value) { return double{value}; });
  return mean([center](float value) { return std::abs(value - center); });
}

// Returns an empty buffer when the backend is out of memory; TrainingViews::allocated() reports it.
template <class T>
Buffer<T> UploadOrNothing(Backend& backend, const std::vector<T>& values, MemoryPlace place) {
  Buffer<T> buffer(backend, static_cast<int64_t>(values.size()), place);
  if (buffer.size() == static_cast<int64_t>(values.size())) buffer.Upload(values);
  return buffer;
}

TrainingView Upload(Backend& backend, const View& view, int factor, const ShrunkView& shrunk,
                    MemoryPlace place) {
  TrainingView out;
  out.pinhole = Shrink(ToPinholeView(view.camera, view.cam_from_world), factor);
  out.photo = UploadOrNothing(backend, factor == 1 ? view.photo.pixels : shrunk.photo, place);
  out.ignore = UploadOrNothing(backend, factor == 1 ? view.ignore : shrunk.ignore, place);
  return out;
}

// Bounds and deviation are those of the full size at all sizes.
void UploadPrior(Backend& backend, const View& view, int factor, MemoryPlace place,
                 TrainingView& out) {
  std::vector<float> prior = ShrinkPrior(view, factor);
  PriorBounds bounds = InlierBounds(view.depth.values);
  out.prior_deviation = MeanDeviation(view.depth.values, bounds);
  if (view.depth.kind == DepthPrior::Kind::kDisparity && !out.inverse_depth) {
    for (float& value : prior) value = -value;
    bounds = {-bounds.max, -bounds.min};
  }
  out.prior = UploadOrNothing(backend, prior, place);
  out.min_prior = bounds.min;
  out.max_prior = bounds.max;
}

}  // namespace

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

// Uploads each training view at 1, 1/2 and 1/4 of its size, or at full size only. The same buffers
// serve all steps: photographs are never uploaded twice. Views are shrunk on all threads, a few at
// a time, so that few shrunk ones are in memory.
TrainingViews::TrainingViews(Backend& backend, const Capture& capture,
                             const TrainingViewsOptions& options) {
  constexpr size_t kAtATime = 64;
  std::vector<const View*> views;
  for (const View& view : capture.views) {
    if (!view.held_out) views.push_back(&view);
  }
  for (size_t first = 0; first < views.size(); first += kAtATime) {
    const size_t count = std::min(kAtATime, views.size() - first);
    std::vector<std::array<ShrunkView, kNumSizes>> shrunk(count);
    OnThreads(options.coarse ? count : 0, [&](size_t i) {
      const View& view = *views[first + i];
      for (int size = 1; size < kNumSizes; ++size) {
        shrunk[i][size] = {ShrinkPhoto(view.photo, 1 << size), ShrinkIgnore(view, 1 << size)};
      }
    });
    for (size_t i = 0; i < count; ++i) Add(backend, *views[first + i], options, shrunk[i]);
  }
}

void TrainingViews::Add(Backend& backend, const View& view, const TrainingViewsOptions& options,
                        const std::array<ShrunkView, kNumSizes>& shrunk) {
  const bool with_prior = options.with_depth && HasGeometryPrior(view);
  auto& sizes = views_.emplace_back();
  for (int size = 0; size < (options.coarse ? kNumSizes : 1); ++size) {
    // Index k has 1 / 2^k of the size, see Schedule::ShrinkAt.
    sizes[size] = Upload(backend, view, 1 << size, shrunk[size], options.place);
    sizes[size].inverse_depth = with_prior && options.disparity_as_inverse_depth &&
                                view.depth.kind == DepthPrior::Kind::kDisparity;
    if (with_prior) UploadPrior(backend, view, 1 << size, options.place, sizes[size]);
    const PinholeView& pinhole = sizes[size].pinhole;
    const int64_t num_pixels = static_cast<int64_t>(pinhole.width) * pinhole.height;
    if (size == 0) num_pixels_ += num_pixels;
    max_pixels_ = std::max(max_pixels_, num_pixels);
    allocated_ = allocated_ && sizes[size].photo.size() == 3 * num_pixels &&
                 (view.ignore.empty() || sizes[size].ignore.size() == num_pixels) &&
                 (!with_prior || sizes[size].prior.size() == num_pixels);
  }
}

int ViewSampler::Next(std::mt19937_64& random) {
  if (left_.empty()) {
    std::uniform_real_distribution<double> uniform(0, 1);
    for (size_t view = 0; view < shares_.size(); ++view) {
      // Nothing is drawn for a share of 1, so that a capture without other shares keeps its order.
      if (shares_[view] >= 1 || uniform(random) < shares_[view]) {
        left_.push_back(static_cast<int>(view));
      }
    }
    // The order depends on the standard library, so a checkpoint continues exactly only in a build
    // with the same one.
    std::shuffle(left_.begin(), left_.end(), random);
  }
  const int next = left_.back();
  left_.pop_back();
  return next;
}

}  // namespace pepeseg
