#include "core/features/estimate.h"

#include <algorithm>

#include "core/features/batch_source.h"
#include "core/features/feature_optimizer.h"
#include "core/features/preparation.h"
#include "core/render/renderer.h"
#include "core/render/weight_sums.h"
#include "kernels/buffer.h"

namespace pepeseg {
namespace {

constexpr int64_t kFloat = sizeof(float);

// Returns the number of pixels of a batch.
int64_t SamplesOf(const FeatureOptions& options) {
  return int64_t{options.num_pixels} + options.num_background_pixels +
         (options.perception_weight > 0 ? options.num_perception_pixels : 0);
}

// Returns the number of pixels of all batches of the largest chunk. No chunk reaches across the end
// of smoothing.
int64_t SamplesInChunk(const FeatureOptions& options) {
  const int smoothed = NumSmoothedSteps(options);
  const int64_t longest = std::max(smoothed, options.num_steps - smoothed);
  return std::min<int64_t>(options.steps_per_chunk, longest) * SamplesOf(options);
}

// Returns the backend memory that MeasureCoverage takes, bytes. scratch: of the largest view.
int64_t CoverageBytes(const Backend& backend, const ScratchSize& scratch) {
  const bool is_small = scratch.num_pixels <= kMaxWeightPixels;
  ScratchSize shrunk = is_small ? scratch : TypicalScratch(scratch.num_gaussians, kMaxWeightPixels);
  shrunk.for_backward = true;
  // A Gaussian takes its planes, two sums over all views and one of a view. A pixel takes its
  // colour and the gradient of it.
  constexpr int64_t kGaussian = (NumPlanes(0) + 3) * kFloat, kPixel = 2 * 3 * kFloat;
  return scratch.num_gaussians * kGaussian + WithReserve(shrunk.num_pixels * kPixel) +
         backend.ScratchBytes(shrunk);
}

}  // namespace

int64_t FeatureDeviceBytes(const Backend& backend, const ScratchSize& scratch, int sh_degree,
                           const FeatureOptions& options) {
  ScratchSize render = scratch;
  render.for_backward = false;
  const CapturedRows rows;
  const int64_t entry = BytesOfRow(rows.gaussian, rows.weight);
  // A sample takes the entries of its blend row twice, as row and as columns. It reaches `reached`
  // Gaussians, with two arrays by column, the lists of their drawn neighbours, and two arrays by
  // neighbour. kLabels bounds its weight, its mask cell and its share of the labels.
  constexpr int64_t kInt = sizeof(int32_t), kLabels = 64;
  const int64_t reached = kTypicalRow / 2;
  const int64_t sample = BytesOfRow(rows.first, rows.alpha) + 2 * kTypicalRow * entry +
                         reached * (2 + options.num_drawn_neighbors + 2) * kInt + kLabels;
  // While it trains, a Gaussian takes four vectors of 32 numbers (feature, two moments, and the
  // copy that FeatureOptimizer::Export smooths), a smoothed feature and its length for each step
  // that is done at once, its last step and its neighbours. A view takes colour, alpha and depth.
  const int64_t at_once =
      FeatureStepsAtOnce(backend.num_branches(), scratch.num_gaussians, options);
  const int64_t gaussian =
      ((4 + at_once) * kFeatureSize + at_once) * kFloat + (1 + options.num_neighbors) * kInt;
  const int64_t image = WithReserve(5 * kFloat * scratch.num_pixels);
  const int64_t one_render = image + backend.ScratchBytes(render);
  // A batch takes features and gradients of its pixels, gradients of the Gaussians that it reaches,
  // the bits of each pair, and partial sums of gradients at each scale.
  const int64_t pixels = SamplesOf(options);
  constexpr int64_t kPairBytes = sizeof(uint32_t), kParts = 4;
  const int64_t batch = pixels * (2 + reached) * kFeatureSize * kFloat +
                        pixels * pixels * kPairBytes +
                        kParts * options.num_scales * (pixels + 64) * kFeatureSize * kFloat;
  // The chunks that are rasterised ahead have a render of their own.
  const int64_t chunk_rows =
      HasTwoChunks(backend)
          ? 2 * WithReserve(SamplesInChunk(OfTwoChunks(options)) * sample) + one_render
          : WithReserve(SamplesInChunk(options) * sample);
  const int64_t training = scratch.num_gaussians * gaussian + chunk_rows +
                           at_once * WithReserve(batch) + (int64_t{options.num_steps} + 1) * kFloat;
  // The planes and the render of a view stay from the preparation to the end of the training.
  return scratch.num_gaussians * NumPlanes(sh_degree) * kFloat + one_render +
         std::max(training, CoverageBytes(backend, scratch));
}

int64_t TypicalFeatureDeviceBytes(const Backend& backend, int64_t num_gaussians, int64_t max_pixels,
                                  int sh_degree, const FeatureOptions& options) {
  return FeatureDeviceBytes(backend, TypicalScratch(num_gaussians, max_pixels), sh_degree, options);
}

int64_t FeatureHostBytes(const ScratchSize& scratch, int sh_degree, const FeatureOptions& options) {
  // The Gaussians, and their features and one moment before the upload or after the download.
  const int64_t gaussian = (NumPlanes(sh_degree) + 2 * kFeatureSize) * kFloat;
  // Pixel, weight and mask cell of a sample, and its share of the labels, of the chunk that is
  // trained and of the next. On a GPU there are three chunks of a third of the steps.
  constexpr int64_t kSample = 64, kChunks = 2;
  // Pixels of a shrunk view, its colours and their gradients: see MeasureCoverage, whose copy of
  // the Gaussians takes less than their features.
  constexpr int64_t kWeightView = kMaxWeightPixels * 2 * (3 * kFloat + 1);
  // Two blocks of depths, each with its alpha, while masks are measured, before the first sample.
  const auto views = static_cast<int64_t>(ViewsInDepthBlock(scratch.num_pixels));
  const int64_t depths = 2 * views * scratch.num_pixels * 2 * kFloat;
  return scratch.num_gaussians * gaussian +
         std::max(kChunks * SamplesInChunk(options) * kSample, depths) + kWeightView;
}

}  // namespace pepeseg
