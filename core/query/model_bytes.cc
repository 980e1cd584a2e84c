#include <algorithm>
#include <cstdint>

#include "core/query/scene_model.h"
#include "core/render/feature_maps.h"
#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

constexpr auto kFloat = static_cast<int64_t>(sizeof(float));
// Bytes per pixel of the outputs that a segmenter keeps for the next query: colours, alpha and
// depth, a mask before and after its border is refined, and its similarities.
constexpr int64_t kPixelBytes = 3 * kFloat + 2 * kFloat + 2 + kFloat;
constexpr int64_t kFixedHostBytes = 1 << 20;  // views, facts, scale quantiles

}  // namespace

MemoryBytes BytesOfModel(const Backend& backend, const ModelShape& shape) {
  const int64_t parameters = (NumPlanes(shape.sh_degree) + kFeatureSize + 1) * kFloat;
  constexpr int64_t kDecomposed =
      Decompositions::kMostKept * int64_t{kPieceDecompositionScales.size()} * kFloat;
  // While a model is read, its features are in memory twice: also in the half floats of the file.
  // It is decomposed only later, so that the larger of the two counts.
  constexpr int64_t kRead = kFeatureSize * static_cast<int64_t>(sizeof(Half));
  const int64_t max_pixels = MostPixels(shape.max_view_pixels);
  ScratchSize scratch = TypicalScratch(shape.num_gaussians, max_pixels);
  // Queries only render; the gradients' memory is for training.
  scratch.for_backward = false;
  MemoryBytes bytes;
  bytes.host = shape.num_gaussians * (parameters + std::max(kDecomposed, kRead)) + kFixedHostBytes;
  bytes.device = shape.num_gaussians * parameters + MapReserve(shape.max_view_pixels) +
                 WithReserve(kPixelBytes * max_pixels) + backend.ScratchBytes(scratch);
  return bytes;
}

}  // namespace pepeseg
