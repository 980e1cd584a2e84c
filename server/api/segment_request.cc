#include "server/api/segment_request.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"
#include "core/scene/camera.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/request_geometry.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

// Maximum number of views that a request may list.
constexpr int kMaxTargets = 1000;

absl::Status CheckEncoding(v1::MaskEncoding encoding) {
  if (v1::MaskEncoding_IsValid(encoding)) return absl::OkStatus();
  return BadField("mask_encoding", absl::StrCat(static_cast<int>(encoding)), "no encoding");
}

// Returns the id of a label, which is given by its id or by its whole name.
absl::StatusOr<std::string> LabelId(const std::string& label, const SceneRef& scene,
                                    const std::string& field) {
  // An id has no slash, and is looked up as it is: one that cannot exist is NOT_FOUND.
  if (label.find('/') == std::string::npos) return label;
  std::optional<SceneNameParts> name = SplitSceneName(label);
  if (!name || name->rest.size() != 2 || name->rest[0] != "labels") {
    return BadField(field, label, "not of the form scenes/{scene}/labels/{label}");
  }
  // A name without a project is of the model's.
  if (name->name != scene.name || (!name->project.empty() && name->project != scene.project)) {
    return BadField(field, label, "a label of another scene");
  }
  return std::move(name->rest[1]);
}

v1::ProposeScalesResponse::Kind ProtoKind(ProposalKind kind) {
  switch (kind) {
    case ProposalKind::kUnnamed:
      break;
    case ProposalKind::kPart:
      return v1::ProposeScalesResponse::KIND_PART;
    case ProposalKind::kObject:
      return v1::ProposeScalesResponse::KIND_OBJECT;
    case ProposalKind::kGroup:
      return v1::ProposeScalesResponse::KIND_GROUP;
  }
  return v1::ProposeScalesResponse::KIND_UNSPECIFIED;
}

// Borders are refined unless the client declines.
template <class Request>
bool RefinesBorders(const Request& request) {
  return !request.has_refine_borders() || request.refine_borders();
}

}  // namespace

v1::ProposeScalesResponse::Proposal ProposalToProto(const ScaleProposal& proposal) {
  v1::ProposeScalesResponse::Proposal proto;
  proto.set_scale_quantile(proposal.result.scale);
  proto.set_threshold(proposal.result.threshold);
  proto.set_scale_units(proposal.result.scale_units);
  proto.set_support(proposal.support);
  proto.set_stability(proposal.stability);
  proto.set_kind(ProtoKind(proposal.kind));
  return proto;
}

absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field) {
  const auto found = std::find_if(model.views.begin(), model.views.end(),
                                  [&](const ModelView& view) { return view.name == name; });
  if (found == model.views.end()) return BadField(field, name, "no view of the model");
  return *found;
}

absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field) {
  switch (viewpoint.place_case()) {
    case v1::Viewpoint::kView:
      return FindView(viewpoint.view(), model, field + ".view");
    case v1::Viewpoint::kFree: {
      ASSIGN_OR_RETURN(ModelView view, FreeViewFromProto(viewpoint.free(), field + ".free"));
      // Clients give world coordinates; the model's are relative to its origin.
      view.cam_from_world = RelativeTo(model.origin, view.cam_from_world);
      return view;
    }
    default:
      return BadField(field, "", "neither a view nor a free camera");
  }
}

absl::StatusOr<Prompt> PromptOfLabel(const LabelRow& label, const Model& model,
                                     const SceneChild& number) {
  const auto view = std::find_if(model.views.begin(), model.views.end(),
                                 [&](const ModelView& v) { return v.name == label.view; });
  if (view == model.views.end()) {
    return WithResource(absl::FailedPreconditionError(absl::StrCat(
                            "label ", label.id, " is of view ", label.view, ", which ",
                            ChildName(number.scene, "models", number.number),
                            " does not have: give the label again in one of its views")),
                        "NO_SUCH_VIEW", LabelName(label.scene, label.id));
  }
  ASSIGN_OR_RETURN(const std::vector<int64_t> counts, ParseCocoCounts(label.counts));
  ASSIGN_OR_RETURN(const std::vector<uint32_t> inside,
                   PixelsOfRuns(counts, label.width, label.height));
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(label.width) * label.height)};
  for (const uint32_t pixel : inside) mask.pixels[pixel] = 1;
  return Prompt{
      *view,
      // A model that was trained later may have its views at another size.
      Resized(mask, {label.width, label.height}, {view->camera.width, view->camera.height})};
}

absl::StatusOr<Prompt> SegmentRequestReader::ReadLabel(const std::string& label,
                                                       const std::string& field) const {
  const SceneRef& scene = number_.scene;
  ASSIGN_OR_RETURN(const std::string id, LabelId(label, scene, field));
  const auto row = store_.labels().GetLabel(scene, id);
  if (!row.ok()) return WithResource(row.status(), "NO_SUCH_LABEL", LabelName(scene, id));
  return PromptOfLabel(*row, model_, number_);
}

absl::StatusOr<Prompt> SegmentRequestReader::ReadPrompt(const v1::Prompt& prompt,
                                                        v1::PixelFrame frame) const {
  const std::string field = "prompt";
  RETURN_IF_ERROR(CheckFrame(frame));
  if (prompt.what_case() == v1::Prompt::kLabel) {
    if (prompt.has_view()) return BadField(field + ".view", "", "a label has its own view");
    return ReadLabel(prompt.label(), field + ".label");
  }
  Prompt read;
  ASSIGN_OR_RETURN(read.view, FindViewpoint(prompt.view(), model_, field + ".view"));
  const ImageOfView image = ImageOf(read.view, frame);
  switch (prompt.what_case()) {
    case v1::Prompt::kPoints: {
      ASSIGN_OR_RETURN(read.what, ReadPoints(prompt.points(), image, field + ".points"));
      return read;
    }
    case v1::Prompt::kBox: {
      ASSIGN_OR_RETURN(read.what, ReadBox(prompt.box(), image, field + ".box"));
      return read;
    }
    case v1::Prompt::kMask: {
      ASSIGN_OR_RETURN(BinaryMask mask, ReadMask(prompt.mask(), image, field + ".mask"));
      ASSIGN_OR_RETURN(read.what, TakeToView(std::move(mask), image, field + ".mask"));
      return read;
    }
    default:
      return BadField(field, "", "no points, box, mask or label");
  }
}

absl::StatusOr<Granularity> SegmentRequestReader::ReadGranularity(
    const v1::Granularity& granularity, const std::string& field) const {
  Granularity read;
  if (granularity.scale_case() == v1::Granularity::kScaleQuantile) {
    read.scale = granularity.scale_quantile();
    if (!(*read.scale >= 0 && *read.scale <= 1)) {
      return BadField(field + ".scale_quantile", absl::StrCat(*read.scale), "not in [0, 1]");
    }
  } else if (granularity.scale_case() == v1::Granularity::kScaleUnits) {
    const double units = granularity.scale_units();
    if (!std::isfinite(units) || units <= 0) {
      return BadField(field + ".scale_units", absl::StrCat(units), "not finite and > 0");
    }
    // Inside, a scale is a quantile of the model's own scales; lengths are converted here.
    read.scale = QuantileOfScale(model_.field, units);
  }
  if (granularity.has_threshold()) {
    read.threshold = granularity.threshold();
    if (!(*read.threshold >= -1 && *read.threshold <= 1)) {
      return BadField(field + ".threshold", absl::StrCat(*read.threshold), "not in [-1, 1]");
    }
  }
  return read;
}

absl::StatusOr<std::vector<ModelView>> SegmentRequestReader::FindTargets(
    const v1::SegmentViewsRequest& request, const ModelView& prompt_view) const {
  const v1::SegmentViewsRequest::Targets& targets = request.targets();
  const bool grouped = targets.group() != v1::SegmentViewsRequest::Targets::GROUP_UNSPECIFIED;
  // Refused rather than merged, since a client that sends both has made an error.
  if (grouped && !targets.views().empty()) {
    return BadField("targets", absl::StrCat(targets.views_size()), "views next to a group");
  }
  if (targets.views_size() > kMaxTargets) {
    return BadField("targets.views", absl::StrCat(targets.views_size()),
                    absl::StrCat("views; allowed are ", kMaxTargets));
  }
  std::vector<ModelView> views;
  switch (targets.group()) {
    case v1::SegmentViewsRequest::Targets::GROUP_UNSPECIFIED:
      break;
    case v1::SegmentViewsRequest::Targets::GROUP_ALL:
      return model_.views;
    case v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT:
      std::copy_if(model_.views.begin(), model_.views.end(), std::back_inserter(views),
                   [](const ModelView& view) { return view.held_out; });
      if (views.empty()) {
        return BadField("targets.group", "GROUP_HELD_OUT", "the model has no held-out view");
      }
      return views;
    default:
      return BadField("targets.group", absl::StrCat(static_cast<int>(targets.group())),
                      "no group of views");
  }
  std::set<std::string> names;
  for (int i = 0; i < targets.views_size(); ++i) {
    // A view that is listed twice is answered once.
    if (!names.insert(targets.views(i)).second) continue;
    ASSIGN_OR_RETURN(ModelView view,
                     FindView(targets.views(i), model_, absl::StrCat("targets.views[", i, "]")));
    views.push_back(std::move(view));
  }
  // Without targets, the view of the prompt is segmented.
  if (views.empty()) views.push_back(prompt_view);
  return views;
}

absl::StatusOr<SegmentQuery> SegmentRequestReader::Read(
    const v1::SegmentViewsRequest& request) const {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  SegmentQuery query;
  ASSIGN_OR_RETURN(query.prompt, ReadPrompt(request.prompt(), request.frame()));
  ASSIGN_OR_RETURN(query.granularity, ReadGranularity(request.granularity(), "granularity"));
  ASSIGN_OR_RETURN(query.targets, FindTargets(request, query.prompt.view));
  query.options = {.want_similarity = request.want_similarity(),
                   .refine_borders = RefinesBorders(request)};
  return query;
}

absl::StatusOr<ProposalQuery> SegmentRequestReader::Read(
    const v1::ProposeScalesRequest& request) const {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  ASSIGN_OR_RETURN(Prompt prompt, ReadPrompt(request.prompt(), request.frame()));
  const auto* points = std::get_if<std::vector<PointPrompt>>(&prompt.what);
  // A box, mask or label already says how large the object is.
  if (points == nullptr) return BadField("prompt", "", "only points have proposals");
  const int wanted = request.max_proposals();
  // Each proposal has a mask in the answer.
  constexpr int kMostProposals = 16;
  if (wanted < 0 || wanted > kMostProposals) {
    return BadField("max_proposals", absl::StrCat(wanted),
                    absl::StrCat("not in [0, ", kMostProposals, "]"));
  }
  return ProposalQuery{std::move(prompt.view),
                       *points,
                       wanted == 0 ? kDefaultProposals : wanted,
                       {.refine_borders = RefinesBorders(request)}};
}

}  // namespace pepeseg
