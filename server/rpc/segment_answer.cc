#include "server/rpc/segment_answer.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/io/encode_png.h"
#include "core/io/rle.h"
#include "core/query/propose_scales.h"
#include "core/status_macros.h"
#include "server/convert.h"
#include "server/rpc/error.h"

namespace pepeseg {
namespace {

constexpr int kMaxTargets = 1000;

absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field) {
  const auto found = std::find_if(model.views.begin(), model.views.end(),
                                  [&](const ModelView& view) { return view.name == name; });
  if (found == model.views.end()) return BadField(field, name, "no view of the model");
  return *found;
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

absl::StatusOr<double> ReadScale(const v1::SegmentRequest& request, const Model& model,
                                 double default_quantile) {
  switch (request.scale_case()) {
    case v1::SegmentRequest::kScaleQuantile: {
      const double quantile = request.scale_quantile();
      if (quantile >= 0 && quantile <= 1) return quantile;
      return BadField("scale_quantile", absl::StrCat(quantile), "not in [0, 1]");
    }
    case v1::SegmentRequest::kScaleUnits: {
      const double units = request.scale_units();
      if (!std::isfinite(units) || units <= 0) {
        return BadField("scale_units", absl::StrCat(units), "not finite and > 0");
      }
      return QuantileOfScale(model.field, units);
    }
    default:
      return default_quantile;
  }
}

// View and points, and whether the answer's encoding is one.
template <class Request>
absl::StatusOr<Segmenter::Prompt> ReadPrompt(const Request& request, const Model& model) {
  if (!v1::MaskEncoding_IsValid(request.mask_encoding())) {
    return BadField("mask_encoding", absl::StrCat(static_cast<int>(request.mask_encoding())),
                    "no encoding");
  }
  Segmenter::Prompt prompt;
  ASSIGN_OR_RETURN(prompt.view, FindViewpoint(request.prompt_view(), model, "prompt_view"));
  if (!request.has_points()) return BadField("prompt", "", "no points");
  ASSIGN_OR_RETURN(prompt.points, PointsFromProto(request.points()));
  return prompt;
}

}  // namespace

absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field) {
  switch (viewpoint.place_case()) {
    case v1::Viewpoint::kView:
      return FindView(viewpoint.view(), model, field + ".view");
    case v1::Viewpoint::kFree:
      return FreeViewFromProto(viewpoint.free(), field + ".free");
    default:
      return BadField(field, "", "neither a view nor a free camera");
  }
}

absl::StatusOr<SegmentQuestion> ReadQuestion(const v1::SegmentRequest& request,
                                             const Model& model) {
  SegmentQuestion question;
  ASSIGN_OR_RETURN(question.prompt, ReadPrompt(request, model));
  Segmenter::Prompt& prompt = question.prompt;
  ASSIGN_OR_RETURN(prompt.scale, ReadScale(request, model, prompt.scale));
  if (request.has_threshold()) {
    prompt.threshold = request.threshold();
    if (!(prompt.threshold >= -1 && prompt.threshold <= 1)) {
      return BadField("threshold", absl::StrCat(prompt.threshold), "not in [-1, 1]");
    }
  }
  ASSIGN_OR_RETURN(question.targets, FindTargets(request, model, prompt.view));
  return question;
}

absl::StatusOr<ProposalQuestion> ReadQuestion(const v1::ProposeScalesRequest& request,
                                              const Model& model) {
  constexpr int kMax = 16;
  const int asked = request.max_proposals();
  if (asked < 0 || asked > kMax) {
    return BadField("max_proposals", absl::StrCat(asked), absl::StrCat("not in [0, ", kMax, "]"));
  }
  ASSIGN_OR_RETURN(Segmenter::Prompt prompt, ReadPrompt(request, model));
  return ProposalQuestion{std::move(prompt), asked == 0 ? kDefaultProposals : asked};
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
  mask.set_area(std::count_if(result.mask.pixels.begin(), result.mask.pixels.end(),
                              [](uint8_t pixel) { return pixel != 0; }));
  if (!result.similarity.empty()) {
    *mask.mutable_similarity() = SimilarityToProto(result.width, result.height, result.similarity);
  }
  return mask;
}

}  // namespace pepeseg
