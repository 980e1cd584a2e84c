#include "server/services/segment_question.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/prompt/propose_scales.h"
#include "server/api/error.h"
#include "server/services/read_prompt.h"

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

absl::StatusOr<SegmentQuestion> ReadQuestion(const ServiceContext& context,
                                             const ResidentModel& model,
                                             const v1::SegmentRequest& request) {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  const Model& of = model.segmenter->model();
  SegmentQuestion question;
  ASSIGN_OR_RETURN(question.prompt, ReadPrompt(context, model, request.prompt(), request.frame()));
  ASSIGN_OR_RETURN(question.granularity, ReadGranularity(request.granularity(), of, "granularity"));
  ASSIGN_OR_RETURN(question.targets, FindTargets(request, of, question.prompt.view));
  return question;
}

absl::StatusOr<ProposalQuestion> ReadQuestion(const ServiceContext& context,
                                              const ResidentModel& model,
                                              const v1::ProposeScalesRequest& request) {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  ASSIGN_OR_RETURN(Prompt prompt, ReadPrompt(context, model, request.prompt(), request.frame()));
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

}  // namespace pepeseg
