#include "core/features/estimate.h"

#include <algorithm>

#include "core/features/feature_optimizer.h"
#include "core/features/gaussian_coverage.h"
#include "core/render/renderer.h"
#include "kernels/buffer.h"

namespace pepeseg {
namespace {

constexpr int64_t kFloat = sizeof(float);

// Returns the number of pixels of a batch.
int64_t SamplesOf(const FeatureOptions& options) {
  return int64_t{options.num_pixels} + options.num_background_pixels +
         (options.perception_weight > 0 ? options.num_perception_pixels : 0);
}

// Returns the number of chunks whose rows are in backend memory at once, see BatchSource.
int NumChunks(const Backend& backend) { return backend.queue_depth() > 0 ? 2 : 1; }

// Returns the number of pixels of all batches of the largest chunk. No chunk reaches across the end
// of smoothing.
int64_t SamplesInChunk(const FeatureOptions& options) {
  const int smoothed = NumSmoothedSteps(options);
  const int64_t longest = std::max(smoothed, options.num_steps - smoothed);
  return std::min<int64_t>(options.steps_per_chunk, longest) * SamplesOf(options);
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
  // A Gaussian takes its planes, four vectors of 32 numbers (feature, two moments, and the copy
  // that FeatureOptimizer::Export smooths), a smoothed feature and its length for each step that is
  // done at once, its last step and its neighbours. A view takes colour, alpha and depth.
  const int64_t at_once = FeatureStepsAtOnce(backend, scratch.num_gaussians, options);
  const int64_t gaussian =
      (NumPlanes(sh_degree) + (4 + at_once) * kFeatureSize + at_once) * kFloat +
      (1 + options.num_neighbors) * kInt;
  const int64_t image = WithReserve(5 * kFloat * scratch.num_pixels);
  // The next chunk has renders of its own.
  const int64_t renders = NumChunks(backend) * (image + backend.ScratchBytes(render));
  // A batch takes features and gradients of its pixels, gradients of the Gaussians that it reaches,
  // the bits of each pair, and partial sums of gradients at each scale.
  const int64_t pixels = SamplesOf(options);
  constexpr int64_t kPairBytes = sizeof(uint32_t), kParts = 4;
  const int64_t batch = pixels * (2 + reached) * kFeatureSize * kFloat +
                        pixels * pixels * kPairBytes +
                        kParts * options.num_scales * (pixels + 64) * kFeatureSize * kFloat;
  return scratch.num_gaussians * gaussian + renders +
         NumChunks(backend) * WithReserve(SamplesInChunk(options) * sample) +
         at_once * WithReserve(batch) + (int64_t{options.num_steps} + 1) * kFloat;
}

int64_t FeatureHostBytes(const ScratchSize& scratch, int sh_degree, const FeatureOptions& options) {
  // The Gaussians, and their features and one moment before the upload or after the download.
  const int64_t gaussian = (NumPlanes(sh_degree) + 2 * kFeatureSize) * kFloat;
  // Pixel, weight and mask cell of a sample, and its share of the labels.
  constexpr int64_t kSample = 64;
  // Rows of uncovered pixels, see FindUncovered.
  constexpr int64_t kRows = kMaxKeptEntries * int64_t{sizeof(int32_t) + sizeof(float)};
  return scratch.num_gaussians * gaussian + SamplesInChunk(options) * kSample + kRows;
}

}  // namespace pepeseg
