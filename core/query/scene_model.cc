#include "core/query/scene_model.h"

#include <utility>
#include <variant>

#include "absl/memory/memory.h"
#include "core/base/status_macros.h"
#include "core/query/resolve_prompt.h"

namespace pepeseg {

absl::StatusOr<SegmentResult> SegmentedViews::Next() {
  RETURN_IF_ERROR(check_());
  const ModelView& target = request_.targets[next_];
  // A free camera has no name, and is a target only if it is the prompt's.
  const BoxPrompt* const box = target.name == request_.prompt.view.name
                                   ? std::get_if<BoxPrompt>(&request_.prompt.what)
                                   : nullptr;
  SegmentOptions options = request_.options;
  options.want_similarity |= request_.image_borders || box != nullptr;
  ASSIGN_OR_RETURN(SegmentResult result, thing_.In(target, options, check_));
  if (request_.image_borders && result.border_image == BorderImage::kNone) {
    RETURN_IF_ERROR(
        request_.images->Refine(target, ImageSegmenter::Change::kBorder, check_, result));
  }
  if (box != nullptr) result.box_agreement = CutToBox(*box, result);
  if (!request_.options.want_similarity) result.similarity.clear();
  Frame frame(target, request_.frame);
  if (!frame_ || !frame_->MapsAs(frame)) frame_ = std::move(frame);
  ++next_;
  return frame_->FromView(std::move(result));
}

void SegmentedViews::LeaveImages() {
  request_.image_borders = false;
  thing_.LeaveOtherImages();
}

absl::StatusOr<std::unique_ptr<SceneModel>> SceneModel::Create(Backend& backend, Model model,
                                                               MapCounts* counts) {
  ASSIGN_OR_RETURN(auto segmenter, Segmenter::Create(backend, std::move(model), counts));
  return absl::WrapUnique(new SceneModel(std::move(segmenter)));
}

absl::StatusOr<SegmentedViews> SceneModel::Segment(SegmentRequest request,
                                                   WantedCheck check) const {
  ASSIGN_OR_RETURN(PromptedThing thing,
                   PromptedThing::Find(*segmenter_, request.image_clicks ? request.images : nullptr,
                                       request.prompt, request.granularity, check));
  if (request.images_of_prompted_view_only) thing.LeaveOtherImages();
  return SegmentedViews(std::move(request), std::move(thing), std::move(check));
}

absl::StatusOr<Proposals> SceneModel::Propose(const ProposeRequest& request) const {
  return pepeseg::Propose(*segmenter_, request);
}

absl::StatusOr<GaussianSet> SceneModel::Select(const SelectRequest& request,
                                               const WantedCheck& check) const {
  ASSIGN_OR_RETURN(
      PromptedThing thing,
      PromptedThing::Find(*segmenter_, request.images, request.prompt, request.granularity, check));
  const auto mask_in = [&](const ModelView& view) { return thing.In(view, {}, check); };
  return SelectGaussians(*segmenter_, request, mask_in, check);
}

absl::Status SceneModel::Decompose(
    std::span<const double> scales,
    absl::FunctionRef<absl::Status(const Decomposition&)> use) const {
  return segmenter_->WithDecomposition(scales, use);
}

absl::StatusOr<RenderedView> SceneModel::Render(const RenderRequest& request) const {
  return RenderFrame(*segmenter_, request);
}

}  // namespace pepeseg
