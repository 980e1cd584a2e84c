#pragma once

#include <filesystem>

#include "absl/status/statusor.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/scene_model.h"

// Embeddings that a training has kept with its model (core/train/photograph_segmentation.h). They
// are of upright photographs with the distortion of the lens, at the size of views.
namespace pepeseg {

// Reads the embedding of the view's photograph from the model's folder. Returns the errors of
// ReadEmbedding, and DATA_LOSS if the photograph has another shape.
absl::StatusOr<SamEmbedding> ReadKeptEmbedding(const std::filesystem::path& model,
                                               const ModelView& view,
                                               const EmbeddingOrigin& origin);

// Returns a mask of the view with its border as SAM sees it in the photograph of the embedding.
// Where the view is warped, so is the mask: pixels that SAM leaves stay exactly as they are.
// Returns the errors of SamBorders::Refine.
absl::StatusOr<BinaryMask> RefineInPhotograph(const SamBorders& sam, const SamEmbedding& embedding,
                                              const ModelView& view, const BinaryMask& mask);

}  // namespace pepeseg
