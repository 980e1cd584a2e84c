#include "core/query/clicked_thing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/base/status_macros.h"
#include "core/query/propose.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {
namespace {

constexpr size_t kMostCorrections = 8;  // that are answered one after the other
constexpr int kMostProposals = 8;       // of the model, to compare with

double IouOf(std::span<const uint8_t> a, std::span<const uint8_t> b) {
  int64_t common = 0, either = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    common += a[i] != 0 && b[i] != 0 ? 1 : 0;
    either += a[i] != 0 || b[i] != 0 ? 1 : 0;
  }
  return either == 0 ? 0 : static_cast<double>(common) / static_cast<double>(either);
}

// Returns the model's masks of a click; none if it shows nothing there.
absl::StatusOr<Proposals> ProposalsAt(const Segmenter& model, const ModelView& view,
                                      const PointPrompt& click) {
  auto proposals = Propose(model, {.prompt = {view, PointsPrompt{click}},
                                   .max_count = kMostProposals,
                                   .frame = FrameKind::kView});
  if (IsNothingThere(proposals.status())) return Proposals();
  return proposals;
}

// Returns how much the model confirms a mask, [0, 1].
double Confirmation(const BinaryMask& mask, const Proposals& proposals) {
  double best = 0;
  for (size_t i = 0; i < proposals.masks.size(); ++i) {
    const double iou = IouOf(mask.pixels, proposals.masks[i].mask.pixels);
    best = std::max(best, iou * iou * std::sqrt(proposals.candidates.list[i].support));
  }
  return best;
}

absl::StatusOr<SoftMask> ChooseFirst(const Segmenter& model, const ModelView& view,
                                     const PointPrompt& click, std::vector<SoftMask> masks) {
  ASSIGN_OR_RETURN(const Proposals proposals, ProposalsAt(model, view, click));
  std::pair<double, double> best = {-1, -1};
  size_t chosen = 0;
  for (size_t i = 0; i < masks.size(); ++i) {
    const double confirmed = masks[i].iou * Confirmation(masks[i].mask, proposals);
    const std::pair<double, double> value = {confirmed, masks[i].iou};
    if (value > best) best = value, chosen = i;
  }
  return std::move(masks[chosen]);
}

// Returns the one mask that all clicks mean in their view.
absl::StatusOr<ImageMasks> Follow(const Segmenter& model, ImageSegmenter& images,
                                  const ModelView& view, std::span<const PointPrompt> clicks,
                                  const WantedCheck& check) {
  size_t num_made = clicks.size() - std::min(clicks.size() - 1, kMostCorrections);
  ASSIGN_OR_RETURN(ImageMasks seen, images.Click(view, clicks.first(num_made), nullptr, check));
  std::erase_if(seen.masks, [](const SoftMask& mask) { return !CheckNotEmpty(mask.mask).ok(); });
  if (seen.masks.empty()) return NothingThereError("SAM sees no thing at the points");
  ASSIGN_OR_RETURN(SoftMask answer, ChooseFirst(model, view, clicks[0], std::move(seen.masks)));
  while (num_made < clicks.size()) {
    RETURN_IF_ERROR(check());
    ++num_made;
    ASSIGN_OR_RETURN(seen, images.Click(view, clicks.first(num_made), &answer, check));
    answer = std::move(seen.masks.front());
  }
  return ImageMasks{{std::move(answer)}, seen.image};
}

}  // namespace

absl::StatusOr<ClickedThing> ClickedThing::Find(const Segmenter& model, ImageSegmenter& images,
                                                const ModelView& view,
                                                std::span<const PointPrompt> clicks,
                                                const WantedCheck& check) {
  RETURN_IF_ERROR(CheckPoints(ImageOf(view), clicks));
  PointsPrompt order(clicks.begin(), clicks.end());
  const auto first = std::find_if(order.begin(), order.end(),
                                  [](const PointPrompt& click) { return click.positive; });
  std::rotate(order.begin(), first, first + 1);
  ASSIGN_OR_RETURN(ImageMasks answer, Follow(model, images, view, order, check));
  return ClickedThing(model, images, view, std::move(answer.masks[0].mask), answer.image);
}

// Fits the query that scores the mask, and decides pixels which the clicked view does not show.
absl::Status ClickedThing::Fit() {
  if (query_) return absl::OkStatus();
  auto query = CheckNotEmpty(mask_).ok() ? FitMask(*model_, view_, mask_, {})
                                         : NothingThereError("the clicks leave nothing");
  if (query.ok()) {
    query_ = *std::move(query);
  } else if (IsNothingThere(query.status())) {
    query_.emplace();
  } else {
    return query.status();
  }
  return absl::OkStatus();
}

absl::StatusOr<SegmentResult> ClickedThing::FromModel(const ModelView& target,
                                                      const SegmentOptions& options) {
  RETURN_IF_ERROR(Fit());
  SegmentOptions with_similarity = options;
  with_similarity.want_similarity = true;
  if (!query_->features.empty()) {
    ASSIGN_OR_RETURN(auto results, model_->Segment(*query_, {&target, 1}, with_similarity));
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

absl::StatusOr<SegmentResult> ClickedThing::In(const ModelView& target,
                                               const SegmentOptions& options,
                                               const WantedCheck& check) {
  ASSIGN_OR_RETURN(SegmentResult result, FromModel(target, options));
  if (target.name == view_.name) {
    SetMask(mask_, result);
    result.border_image = image_;
  } else {
    if (!depth_) {
      ASSIGN_OR_RETURN(std::vector<float> depth, model_->RenderDepth(view_));
      depth_ = {view_, std::move(depth)};
    }
    ViewDepth there = {target, {}};
    ASSIGN_OR_RETURN(there.depth, model_->RenderDepth(target));
    const TransferredMask seen = TransferMask(*depth_, mask_.pixels, there);
    BinaryMask mask = result.mask;
    for (size_t i = 0; i < mask.pixels.size(); ++i) {
      if (seen.known[i] != 0) mask.pixels[i] = seen.inside[i];
    }
    SetMask(std::move(mask), result);
    RETURN_IF_ERROR(images_->Refine(target, ImageSegmenter::Change::kWhole, check, result));
  }
  if (!options.want_similarity) result.similarity.clear();
  return result;
}

}  // namespace pepeseg
