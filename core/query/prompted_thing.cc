#include "core/query/prompted_thing.h"

#include <cstddef>
#include <cstdint>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/status_macros.h"
#include "core/query/box_meaning.h"
#include "core/query/click_follower.h"
#include "core/query/mask_geometry.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

absl::StatusOr<PromptMeaning> FindMeaning(const Segmenter& model, ImageSegmenter* images,
                                          const Prompt& prompt, const Granularity& granularity,
                                          const WantedCheck& check) {
  const auto* const clicks = std::get_if<PointsPrompt>(&prompt.what);
  const auto* const box = std::get_if<BoxPrompt>(&prompt.what);
  const bool is_given = granularity.scale && granularity.threshold;
  if (clicks != nullptr && !is_given) {
    RETURN_IF_ERROR(CheckGranularity(granularity));
    ClickFollower follower(model, images, prompt.view, granularity);
    RETURN_IF_ERROR(follower.Follow(*clicks, prompt.previous, check));
    return follower.meaning();
  }
  if (box != nullptr && images != nullptr) {
    return FindInBox(model, *images, prompt.view, *box, check);
  }
  PromptMeaning meaning;
  ASSIGN_OR_RETURN(meaning.query, ResolvePrompt(model, prompt, granularity));
  meaning.is_of_query = true;
  return meaning;
}

}  // namespace

absl::StatusOr<PromptedThing> PromptedThing::Find(const Segmenter& model, ImageSegmenter* images,
                                                  const Prompt& prompt,
                                                  const Granularity& granularity,
                                                  const WantedCheck& check) {
  ASSIGN_OR_RETURN(PromptMeaning meaning, FindMeaning(model, images, prompt, granularity, check));
  return PromptedThing(model, images, prompt.view, std::move(meaning));
}

// Finds the query that decides pixels which the prompt's view does not show, and scores a mask that
// the model did not find.
absl::Status PromptedThing::Fit() {
  if (query_) return absl::OkStatus();
  auto query = CheckNotEmpty(meaning_.mask).ok() ? FitMask(*model_, view_, meaning_.mask, {})
                                                 : NothingThereError("the prompt leaves nothing");
  if (query.ok()) {
    query_ = *std::move(query);
  } else if (IsNothingThere(query.status())) {
    query_.emplace();
  } else {
    return query.status();
  }
  return absl::OkStatus();
}

absl::StatusOr<SegmentResult> PromptedThing::MaskOf(const Query& query, const ModelView& target,
                                                    const SegmentOptions& options) const {
  if (!query.features.empty()) {
    ASSIGN_OR_RETURN(auto results, model_->Segment(query, {&target, 1}, options));
    return std::move(results.front());
  }
  SegmentResult nothing;
  nothing.view = target.name;
  nothing.width = target.camera.width;
  nothing.height = target.camera.height;
  const size_t num_pixels = static_cast<size_t>(nothing.width) * nothing.height;
  nothing.mask.pixels.resize(num_pixels);
  nothing.similarity.resize(num_pixels);
  return nothing;
}

absl::StatusOr<TransferredMap> PromptedThing::Transfer(std::span<const uint8_t> map,
                                                       const ModelView& target) {
  if (!depth_) {
    ASSIGN_OR_RETURN(std::vector<float> depth, model_->RenderDepth(view_));
    depth_ = {view_, std::move(depth)};
  }
  ViewDepth there = {target, {}};
  ASSIGN_OR_RETURN(there.depth, model_->RenderDepth(target));
  return TransferMap(*depth_, map, there);
}

// The pixels that the prompt's view shows are those of its mask.
absl::StatusOr<SegmentResult> PromptedThing::SeenIn(const ModelView& target,
                                                    const SegmentOptions& options) {
  RETURN_IF_ERROR(Fit());
  ASSIGN_OR_RETURN(SegmentResult result, MaskOf(*query_, target, options));
  ASSIGN_OR_RETURN(const TransferredMap seen, Transfer(meaning_.mask.pixels, target));
  BinaryMask mask = result.mask;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (seen.known[i] != 0) mask.pixels[i] = seen.values[i];
  }
  SetMask(std::move(mask), result);
  return result;
}

// Borders of a mask do not survive the way through the depths of two views, so that only what
// clicks changed takes it. Pixels that the prompt's view does not show have no query but Fit's.
absl::StatusOr<SegmentResult> PromptedThing::ChangedIn(const ModelView& target,
                                                       const SegmentOptions& options) {
  constexpr uint8_t kOut = 1, kIn = 2;
  const std::vector<uint8_t>& mask = meaning_.mask.pixels;
  std::vector<uint8_t> changes(mask.size());
  for (size_t i = 0; i < changes.size(); ++i) {
    if (mask[i] != meaning_.unchanged.pixels[i]) changes[i] = mask[i] != 0 ? kIn : kOut;
  }
  RETURN_IF_ERROR(Fit());
  ASSIGN_OR_RETURN(const SegmentResult unchanged, MaskOf(meaning_.query, target, options));
  ASSIGN_OR_RETURN(SegmentResult result, MaskOf(*query_, target, options));
  ASSIGN_OR_RETURN(const TransferredMap seen, Transfer(changes, target));
  BinaryMask changed = result.mask;
  for (size_t i = 0; i < changed.pixels.size(); ++i) {
    if (seen.known[i] == 0) continue;
    changed.pixels[i] =
        seen.values[i] == 0 ? unchanged.mask.pixels[i] : uint8_t{seen.values[i] == kIn};
  }
  SetMask(std::move(changed), result);
  return result;
}

absl::StatusOr<SegmentResult> PromptedThing::In(const ModelView& target,
                                                const SegmentOptions& options,
                                                const WantedCheck& check) {
  if (meaning_.is_of_query) return MaskOf(meaning_.query, target, options);
  SegmentOptions with_similarity = options;
  with_similarity.want_similarity = true;  // SetMask needs it
  SegmentResult result;
  if (target.name == view_.name) {
    const bool is_known = !meaning_.query.features.empty();
    if (!is_known) RETURN_IF_ERROR(Fit());
    ASSIGN_OR_RETURN(result, MaskOf(is_known ? meaning_.query : *query_, target, with_similarity));
    SetMask(meaning_.mask, result);
    result.border_image = meaning_.image;
  } else {
    const bool is_changed = !meaning_.unchanged.pixels.empty();
    ASSIGN_OR_RETURN(
        result, is_changed ? ChangedIn(target, with_similarity) : SeenIn(target, with_similarity));
    if (images_ != nullptr) {
      RETURN_IF_ERROR(images_->Refine(target, ImageSegmenter::Change::kWhole, check, result));
    }
  }
  if (!options.want_similarity) result.similarity.clear();
  return result;
}

}  // namespace pepeseg
