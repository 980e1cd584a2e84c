#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/priors/sam/click_masks.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_embedding.h"
#include "core/priors/sam/sam_segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// How far a segmenter may change a mask.
struct RefineLimits {
  // Pixels farther from the mask's border stay, diagonals of the image.
  double reach = 0.02;
  // The mask stays as it is where the segmenter sees another thing: one with a smaller IoU.
  double same_thing = 0.7;
};
// For a mask that is only roughly known, such as one from another view.
inline constexpr RefineLimits kRefineWhole = {2, 0.6};

// Returns the mask, [height, width] of the segmenter's photograph, as the segmenter sees its thing.
// Returns the errors of SegmentByMask.
absl::StatusOr<BinaryMask> RefineMask(PromptedSegmenter& segmenter, const BinaryMask& mask,
                                      int width, int height, const RefineLimits& limits = {});

// Moves the borders of masks to those that SAM's decoder sees in an image, prompted by the mask
// itself (METHOD.md section 4, "Borders by SAM"). Measured: tests/bench/results/borders.md.
// Thread-safe; each call that computes on the CPU next to another one takes memory of its own.
class SamBorders {
 public:
  // Opens the networks of a folder that deploy/sam.sh has made, see SamModel. Returns the errors of
  // SamModel::Open.
  static absl::StatusOr<std::unique_ptr<SamBorders>> Open(const std::filesystem::path& folder,
                                                          SamOptions options);

  // Returns what Refine needs of an RGB image. Takes about half a second of a core, or 2 ms of a
  // GPU. Returns RESOURCE_EXHAUSTED when out of memory.
  absl::StatusOr<SamEmbedding> Embed(const Image& image) const;

  // Returns the mask, which has the size of the embedding, as RefineMask does. Takes about 0.05 s
  // of a core. Returns the errors of Embed, and INVALID_ARGUMENT for an embedding of another SAM's
  // size.
  absl::StatusOr<BinaryMask> Refine(const SamEmbedding& embedding, const BinaryMask& mask,
                                    const RefineLimits& limits = {}) const;
  // Returns the masks of clicks, see SegmentClicks, of the size of the embedding. Errors and time
  // are those of Refine.
  absl::StatusOr<std::vector<SoftMask>> Click(const SamEmbedding& embedding,
                                              std::span<const PromptPoint> clicks,
                                              const SoftMask* before) const;
  // Returns the masks of a box, see SegmentBox; the same holds.
  absl::StatusOr<std::vector<SoftMask>> Box(const SamEmbedding& embedding,
                                            const std::array<PromptPoint, 2>& box) const;

  // As SamModel's functions of these names.
  const std::string& encoder_digest() const { return model_->encoder_digest(); }
  std::string processor() const { return model_->processor(); }
  bool cuda_failed() const { return model_->cuda_failed(); }

 private:
  explicit SamBorders(std::unique_ptr<SamModel> model) : model_(std::move(model)) {}

  const std::unique_ptr<SamModel> model_;
};

}  // namespace pepeseg
