#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/image_segmenter.h"
#include "core/query/mask_geometry.h"
#include "core/scene/capture.h"

namespace pepeseg {

// SAM in the photographs of a capture, which must outlive it. Keeps what it needs of each view.
class PackImages final : public ImageSegmenter {
 public:
  PackImages(const SamBorders& sam, const Capture& capture) : sam_(sam) {
    for (const View& view : capture.views) photographs_[view.name] = &view.photo;
  }

  absl::StatusOr<ImageMasks> Click(const ModelView& view, std::span<const PointPrompt> clicks,
                                   const SoftMask* before, const WantedCheck& check) override {
    RETURN_IF_ERROR(check());
    ASSIGN_OR_RETURN(const SamEmbedding* embedding, EmbeddingOf(view));
    std::vector<PromptPoint> points;
    for (const PointPrompt& click : clicks) {
      points.push_back({static_cast<float>(click.x), static_cast<float>(click.y), click.positive});
    }
    ImageMasks result;
    ASSIGN_OR_RETURN(result.masks, sam_.Click(*embedding, points, before));
    return result;
  }

  absl::StatusOr<ImageMasks> Box(const ModelView& view, const BoxPrompt& box,
                                 const WantedCheck& check) override {
    RETURN_IF_ERROR(check());
    ASSIGN_OR_RETURN(const SamEmbedding* embedding, EmbeddingOf(view));
    const std::array<PromptPoint, 2> corners = {
        PromptPoint{static_cast<float>(box.x), static_cast<float>(box.y)},
        PromptPoint{static_cast<float>(box.x + box.width), static_cast<float>(box.y + box.height)}};
    ImageMasks result;
    ASSIGN_OR_RETURN(result.masks, sam_.Box(*embedding, corners));
    return result;
  }

  absl::Status Refine(const ModelView& view, Change change, const WantedCheck& check,
                      SegmentResult& result) override {
    RETURN_IF_ERROR(check());
    ASSIGN_OR_RETURN(const SamEmbedding* embedding, EmbeddingOf(view));
    ASSIGN_OR_RETURN(BinaryMask mask,
                     sam_.Refine(*embedding, result.mask,
                                 change == Change::kWhole ? kRefineWhole : RefineLimits()));
    SetMask(std::move(mask), result);
    result.border_image = BorderImage::kPhotograph;
    return absl::OkStatus();
  }

 private:
  absl::StatusOr<const SamEmbedding*> EmbeddingOf(const ModelView& view) {
    SamEmbedding& embedding = embeddings_[view.name];
    if (embedding.values.empty()) {
      ASSIGN_OR_RETURN(embedding, sam_.Embed(*photographs_.at(view.name)));
    }
    return &embedding;
  }

  const SamBorders& sam_;
  std::map<std::string, const Image*> photographs_;
  std::map<std::string, SamEmbedding> embeddings_;
};

}  // namespace pepeseg
