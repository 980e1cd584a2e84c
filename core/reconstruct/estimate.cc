#include "core/reconstruct/estimate.h"

#include <algorithm>
#include <cmath>

#include "core/reconstruct/few_visits.h"
#include "core/reconstruct/gaussian_state.h"
#include "core/reconstruct/pixel_budget.h"
#include "core/reconstruct/step_queue.h"
#include "core/render/renderer.h"
#include "core/scene/capture.h"
#include "kernels/buffer.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

// Returns the options that the training uses for photographs of this size.
ReconstructOptions Budgeted(const TrainingSize& size, const ReconstructOptions& options) {
  const auto num_views = static_cast<double>(std::max<int64_t>(1, size.num_views));
  const ViewPixels views = {static_cast<double>(size.num_training_views),
                            static_cast<double>(size.num_pixels) / num_views};
  return FitToViews(options, views);
}

bool ControlsDensity(const ReconstructOptions& options) {
  return options.densify_until > options.densify_from;
}

int64_t FirstGaussians(const TrainingSize& size, const ReconstructOptions& options) {
  const int64_t points = size.num_points > 0 ? size.num_points : options.num_random_points;
  return std::min(points, options.max_gaussians);
}

// Returns the bytes of photographs, ignore masks and priors in backend memory. Views are taken to
// be of one size: the mean.
int64_t ViewBytes(const TrainingSize& size, const ReconstructOptions& options) {
  const int64_t num_views = std::max<int64_t>(1, size.num_views);
  const int64_t num_pixels = size.num_pixels / num_views * size.num_training_views;
  const int64_t ignore = size.num_ignore_views > 0 ? 1 : 0;
  // RGB of 8 bits, and a byte of the ignore mask where any view has one.
  const int64_t bytes = num_pixels * (3 + ignore);
  const int64_t depth =
      size.num_pixels / num_views * size.num_depth_views * static_cast<int64_t>(sizeof(float));
  // The coarse sizes take a quarter and a sixteenth of it.
  const int64_t views = bytes + depth;
  return options.coarse_until > 0 ? views + views / 2 : views;
}

// Returns the bytes of the images of the depth loss: rendered alpha and depth, and their gradients;
// ones in place of alpha, see DepthTerm.
int64_t DepthImageBytes(const TrainingSize& size) {
  return size.num_depth_views > 0 ? 5 * size.max_pixels * static_cast<int64_t>(sizeof(float)) : 0;
}

bool Refines(const TrainingSize& size, const ReconstructOptions& options) {
  return size.num_masked_views > 0 && options.refine_keep != RefineKeep::kNone;
}

// Returns the bytes of the masks for refinement in backend memory.
int64_t MaskBytes(const TrainingSize& size, const ReconstructOptions& options) {
  if (!Refines(size, options)) return 0;
  const int64_t mean_pixels = size.num_pixels / std::max<int64_t>(1, size.num_views);
  return std::min(size.num_masked_views, size.num_training_views) * mean_pixels *
         static_cast<int64_t>(sizeof(uint32_t));
}

int64_t TrainingPixels(const TrainingSize& size) {
  return size.num_pixels / std::max<int64_t>(1, size.num_views) * size.num_training_views;
}

// Returns the largest number of Gaussians at the end of refinement, see Densifier::BudgetAt.
int64_t GaussiansInRefinement(const TrainingSize& size, const ReconstructOptions& options) {
  const int64_t first = FirstGaussians(size, options), most = MostGaussians(size, options);
  if (options.pixels_per_gaussian <= 0) return most;
  // Refiner moves a start before coarse_until to coarse_until, the first step at full size.
  const double end = std::max(options.refine_from, options.coarse_until) + options.refine_length;
  const double span = options.densify_until - options.densify_from;
  const double passed = span > 0 ? std::clamp((end - options.densify_from) / span, 0.0, 1.0) : 1.0;
  return first + static_cast<int64_t>(static_cast<double>(most - first) * passed);
}

// Returns the bytes of refinement without the masks: a render, and the working memory for each
// Gaussian in view.
int64_t RefinerBytes(const Backend& backend, const TrainingSize& size,
                     const ReconstructOptions& options) {
  if (!Refines(size, options)) return 0;
  const int64_t count = GaussiansInRefinement(size, options);
  const int64_t images = 5 * size.max_pixels * static_cast<int64_t>(sizeof(float));
  const RefineScratch s;
  const bool split = options.refine_keep != RefineKeep::kShrink;
  constexpr int64_t kShape = 6;
  const int64_t added = sizeof(int32_t) + kShape * sizeof(float);  // a Gaussian's part outside
  const int64_t row = BytesOfRow(s.keys, s.keys, s.outside_position, s.outside_position) +
                      kShape * BytesOfRow(s.outside_shape) + (split ? added : 0);
  return WithReserve(images + row * count) +
         backend.ScratchBytes(TypicalScratch(count, size.max_pixels));
}

}  // namespace

int64_t MostGaussians(const TrainingSize& size, const ReconstructOptions& options) {
  const int64_t first = FirstGaussians(size, options);
  if (!ControlsDensity(options)) return first;
  const double pixels_per_gaussian = Budgeted(size, options).pixels_per_gaussian;
  if (pixels_per_gaussian <= 0) return options.max_gaussians;
  const double budget = static_cast<double>(TrainingPixels(size)) / pixels_per_gaussian;
  return std::max(
      first, static_cast<int64_t>(std::min(budget, static_cast<double>(options.max_gaussians))));
}

int64_t CaptureBytes(const TrainingSize& size) {
  const int64_t pixels = size.num_pixels / std::max<int64_t>(1, size.num_views);
  const int64_t patch = sizeof(uint32_t), depth = sizeof(float);
  return 3 * size.num_pixels +
         pixels * (size.num_masked_views * patch + size.num_ignore_views +
                   size.num_depth_views * depth) +
         size.num_points * static_cast<int64_t>(sizeof(ScenePoint));
}

MemoryNeed EstimateReconstruct(const Backend& backend, const TrainingSize& size,
                               const ReconstructOptions& given) {
  const ReconstructOptions options = Budgeted(size, given);
  const int64_t first = FirstGaussians(size, options), most = MostGaussians(size, options);
  // Density control builds the next state while the present one exists. Its plan has a source, a
  // flag, a mean and scales for each Gaussian.
  const int64_t state = GaussianState::Bytes(first, most, options.sh_degree);
  constexpr int64_t kPlanRow = sizeof(int32_t) + 1 + 6 * sizeof(float);
  const bool twice = ControlsDensity(options);
  // The rendered colours and their gradients, and what a render takes.
  int64_t slots = 0;
  for (const int64_t pixels : SlotPixels(backend, options, size.max_pixels)) {
    slots += 2 * 3 * pixels * static_cast<int64_t>(sizeof(float)) +
             backend.ScratchBytes(TypicalScratch(most, pixels));
  }
  MemoryNeed need;
  need.movable_bytes = ViewBytes(size, options) + MaskBytes(size, options);
  need.device_bytes = need.movable_bytes + DepthImageBytes(size) +
                      (twice ? 2 * state + kPlanRow * most * 5 / 4 : state) + slots +
                      RefinerBytes(backend, size, options);
  // The result, a checkpoint that is being written, and the points with their k-d tree.
  const int64_t planes = NumPlanes(options.sh_degree) * static_cast<int64_t>(sizeof(float));
  constexpr int64_t kNeighbours = 64;
  need.host_bytes = CaptureBytes(size) + most * (4 * planes + 12) + first * (planes + kNeighbours);
  return options.photographs_on_host ? WithPhotographsOnHost(need) : need;
}

MemoryNeed WithPhotographsOnHost(MemoryNeed need) {
  need.device_bytes -= need.movable_bytes;
  need.host_bytes += need.movable_bytes;
  need.movable_bytes = 0;
  return need;
}

TrainingSize SizeOf(const Capture& capture) {
  TrainingSize size;
  size.num_points = static_cast<int64_t>(capture.points.size());
  for (const View& view : capture.views) {
    const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
    ++size.num_views;
    size.num_training_views += view.held_out ? 0 : 1;
    size.num_pixels += num_pixels;
    size.max_pixels = std::max(size.max_pixels, num_pixels);
    size.num_masked_views += view.masks.empty() ? 0 : 1;
    size.num_ignore_views += view.ignore.empty() ? 0 : 1;
    size.num_depth_views += view.depth.values.empty() ? 0 : 1;
  }
  return size;
}

MemoryPlace PhotographPlace(const Backend& backend, const TrainingSize& size,
                            const ReconstructOptions& options) {
  if (options.photographs_on_host) return MemoryPlace::kHost;
  const DeviceMemory memory = backend.memory();
  if (memory.is_host) return MemoryPlace::kDevice;
  const MemoryNeed need = EstimateReconstruct(backend, size, options);
  return need.device_bytes > memory.free_bytes ? MemoryPlace::kHost : MemoryPlace::kDevice;
}

}  // namespace pepeseg
