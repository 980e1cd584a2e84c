#include "server/rpc/segment_answer.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/io/encode_png.h"
#include "core/io/rle.h"
#include "core/query/propose_scales.h"
#include "core/status_macros.h"
#include "server/convert.h"
#include "server/rpc/error.h"
#include "server/rpc/read_prompt.h"

namespace pepeseg {
namespace {

constexpr int kMaxTargets = 1000;

absl::Status CheckEncoding(v1::MaskEncoding encoding) {
  if (v1::MaskEncoding_IsValid(encoding)) return absl::OkStatus();
  return BadField("mask_encoding", absl::StrCat(static_cast<int>(encoding)), "no encoding");
}

absl::StatusOr<std::vector<ModelView>> FindTargets(const v1::SegmentRequest& request,
                                                   const Model& model,
                                                   const ModelView& prompt_view) {
  const v1::SegmentRequest::Targets& targets = request.targets();
  const bool grouped = targets.group() != v1::SegmentRequest::Targets::GROUP_UNSPECIFIED;
  if (grouped && !targets.views().empty()) {
    return BadField("targets", absl::StrCat(targets.views_size()), "views beside a group");
  }
  if (targets.views_size() > kMaxTargets) {
    return BadField("targets.views", absl::StrCat(targets.views_size()),
                    absl::StrCat("views; allowed are ", kMaxTargets));
  }
  std::vector<ModelView> views;
  switch (targets.group()) {
    case v1::SegmentRequest::Targets::GROUP_UNSPECIFIED:
      break;
    case v1::SegmentRequest::Targets::GROUP_ALL:
      return model.views;
    case v1::SegmentRequest::Targets::GROUP_HELD_OUT:
      std::copy_if(model.views.begin(), model.views.end(), std::back_inserter(views),
                   [](const ModelView& view) { return view.held_out; });
      if (views.empty()) {
        return BadField("targets.group", "GROUP_HELD_OUT", "the model has no held-out view");
      }
      return views;
    default:
      return BadField("targets.group", absl::StrCat(static_cast<int>(targets.group())),
                      "no group of views");
  }
  for (const std::string& name : targets.views()) {
    ASSIGN_OR_RETURN(ModelView view,
                     FindView(name, model, absl::StrCat("targets.views[", views.size(), "]")));
    views.push_back(std::move(view));
  }
  if (views.empty()) views.push_back(prompt_view);
  return views;
}

}  // namespace

absl::StatusOr<SegmentQuestion> ReadQuestion(const v1::SegmentRequest& request,
                                             const Model& model) {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  SegmentQuestion question;
  ASSIGN_OR_RETURN(question.prompt, ReadPrompt(request.prompt(), model, "prompt"));
  ASSIGN_OR_RETURN(question.granularity,
                   ReadGranularity(request.granularity(), model, "granularity"));
  ASSIGN_OR_RETURN(question.targets, FindTargets(request, model, question.prompt.view));
  return question;
}

absl::StatusOr<ProposalQuestion> ReadQuestion(const v1::ProposeScalesRequest& request,
                                              const Model& model) {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  ASSIGN_OR_RETURN(Prompt prompt, ReadPrompt(request.prompt(), model, "prompt"));
  const auto* points = std::get_if<std::vector<PointPrompt>>(&prompt.what);
  if (points == nullptr) return BadField("prompt", "", "only points have proposals");
  const int wanted = request.max_proposals();
  constexpr int kMostProposals = 16;
  if (wanted < 0 || wanted > kMostProposals) {
    return BadField("max_proposals", absl::StrCat(wanted),
                    absl::StrCat("not in [0, ", kMostProposals, "]"));
  }
  return ProposalQuestion{std::move(prompt.view), *points,
                          wanted == 0 ? kDefaultProposals : wanted};
}

absl::StatusOr<v1::SegmentResponse::ViewMask> EncodeMask(const std::string& view,
                                                         const SegmentResult& result,
                                                         v1::MaskEncoding encoding) {
  v1::SegmentResponse::ViewMask mask;
  mask.set_view(view);
  if (encoding == v1::MASK_ENCODING_PNG) {
    Image image{result.width, result.height, 1, result.mask.pixels};
    for (uint8_t& pixel : image.pixels) pixel = pixel != 0 ? 255 : 0;
    ASSIGN_OR_RETURN(*mask.mutable_png(), EncodePng(image));
  } else {
    v1::CocoRle& rle = *mask.mutable_rle();
    rle.set_height(result.height);
    rle.set_width(result.width);
    rle.set_counts(EncodeCocoRle(result.mask, result.width, result.height));
  }
  mask.set_score(result.score);
  mask.mutable_box()->set_x(result.box[0]);
  mask.mutable_box()->set_y(result.box[1]);
  mask.mutable_box()->set_width(result.box[2]);
  mask.mutable_box()->set_height(result.box[3]);
  mask.set_area(result.area);
  if (!result.similarity.empty()) {
    *mask.mutable_similarity() = SimilarityToProto(result.width, result.height, result.similarity);
  }
  return mask;
}

}  // namespace pepeseg
