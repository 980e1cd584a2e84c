#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/scene_model.h"

// Embeddings that a training has kept with its model (core/train/photograph_segmentation.h). They
// are of upright photographs with the distortion of the lens, at the size of views.
namespace pepeseg {

// Cells along the longer side of an image in its embedding.
inline constexpr int kSamCells = 64;

// Reads the embedding of the view's photograph from the model's folder. Returns the errors of
// ReadEmbedding, and DATA_LOSS if the photograph has another shape.
absl::StatusOr<SamEmbedding> ReadKeptEmbedding(const std::filesystem::path& model,
                                               const ModelView& view,
                                               const EmbeddingOrigin& origin);

// SAM in the image of a view, by its embedding. What it refers to must outlive it.
struct PhotographSam {
  const SamBorders& sam;
  const SamEmbedding& embedding;
  const ModelView& view;
  // Whether the embedding is of the photograph, from which the view is warped. Then clicks and
  // masks are warped as well: pixels of a mask that SAM leaves stay exactly as they are.
  bool is_of_photograph;

  // Returns a mask of the view as SAM sees it, see RefineMask. Returns the errors of
  // SamBorders::Refine.
  absl::StatusOr<BinaryMask> Refine(const BinaryMask& mask, const RefineLimits& limits) const;
  // Returns the masks of clicks in the view, see SegmentClicks. Errors are those of Refine.
  absl::StatusOr<std::vector<SoftMask>> Click(std::span<const PointPrompt> clicks,
                                              const SoftMask* before) const;
  // Returns the masks of a box in the view, see SegmentBox. Errors are those of Refine.
  absl::StatusOr<std::vector<SoftMask>> Box(const BoxPrompt& box) const;
  // Returns the place of the embedding, [kSamCells, kSamCells], that each pixel of a grid of width
  // x height pixels over the view is in.
  std::vector<int32_t> CellsOf(int width, int height) const;
};

}  // namespace pepeseg
