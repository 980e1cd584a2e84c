#include "server/api/segment_request.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

absl::Status CheckEncoding(v1::MaskEncoding encoding) {
  if (v1::MaskEncoding_IsValid(encoding)) return absl::OkStatus();
  return BadField("mask_encoding", absl::StrCat(static_cast<int>(encoding)), "no encoding");
}

// These convert what a prompt says in pixels of the image, of any values.

PointsPrompt PointsFromProto(const v1::PointsPrompt& proto) {
  PointsPrompt points;
  for (const v1::PointsPrompt::Point& point : proto.points()) {
    points.push_back({point.x(), point.y(), !point.negative()});
  }
  return points;
}

std::vector<Stroke> StrokesFromProto(const v1::ScribblesPrompt& proto) {
  std::vector<Stroke> strokes;
  for (const v1::ScribblesPrompt::Stroke& from : proto.strokes()) {
    Stroke& stroke = strokes.emplace_back(Stroke{{}, !from.negative(), from.width()});
    for (const auto& vertex : from.path()) stroke.path.emplace_back(vertex.x(), vertex.y());
  }
  return strokes;
}

absl::StatusOr<Scribbles> ReadScribbles(const v1::ScribblesPrompt& proto, const Frame& image,
                                        const std::string& field) {
  absl::StatusOr<Scribbles> scribbles = image.Draw(StrokesFromProto(proto));
  if (!scribbles.ok()) return AtField(scribbles.status(), field);
  const auto add = [&](const v1::MaskImage& strokes, const char* name,
                       BinaryMask& to) -> absl::Status {
    ASSIGN_OR_RETURN(const BinaryMask mask, ReadMask(strokes, image, absl::StrCat(field, name)));
    to.pixels.resize(mask.pixels.size());
    for (size_t i = 0; i < to.pixels.size(); ++i) to.pixels[i] |= mask.pixels[i];
    return absl::OkStatus();
  };
  if (proto.has_positive()) {
    RETURN_IF_ERROR(add(proto.positive(), ".positive", scribbles->positive));
  }
  if (proto.has_negative()) {
    RETURN_IF_ERROR(add(proto.negative(), ".negative", scribbles->negative));
  }
  return scribbles;
}

// Reads what a prompt says in pixels of the image, and puts its field into `field`.
absl::StatusOr<Shape> ReadShape(const v1::Prompt& prompt, const Frame& image, std::string& field) {
  switch (prompt.what_case()) {
    case v1::Prompt::kPoints:
      field += ".points";
      return PointsFromProto(prompt.points());
    case v1::Prompt::kBox:
      field += ".box";
      return BoxPrompt{prompt.box().x(), prompt.box().y(), prompt.box().width(),
                       prompt.box().height()};
    case v1::Prompt::kMask:
      field += ".mask";
      return ReadMask(prompt.mask(), image, field);
    case v1::Prompt::kScribbles:
      field += ".scribbles";
      return ReadScribbles(prompt.scribbles(), image, field);
    case v1::Prompt::kPointMean:
      field += ".point_mean";
      return PointMean{PointsFromProto(prompt.point_mean())};
    default:
      return BadField(field, "", "no points, box, mask, scribbles, point_mean or label");
  }
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

absl::Status FillProposals(const Proposals& proposals, v1::MaskEncoding encoding,
                           v1::ProposeScalesResponse* response) {
  const auto& [list, best] = proposals.candidates;
  for (size_t i = 0; i < list.size(); ++i) {
    const SegmentResult& mask = proposals.masks[i];
    v1::ProposeScalesResponse::Proposal& proto = *response->add_proposals();
    proto.set_scale_quantile(mask.scale);
    proto.set_threshold(mask.threshold);
    proto.set_scale_units(mask.scale_units);
    proto.set_support(list[i].support);
    proto.set_stability(list[i].stability);
    const auto count = static_cast<int>(list.size());
    proto.set_kind(ProtoKind(KindOf(static_cast<int>(i), count, best)));
    ASSIGN_OR_RETURN(*proto.mutable_mask(), EncodeMask(mask, encoding));
  }
  response->set_best(best);
  return absl::OkStatus();
}

absl::StatusOr<ModelView> FreeViewFromProto(const v1::Viewpoint::FreeCamera& proto,
                                            const std::string& field) {
  const auto required = [&](const char* name) {
    return AtField(FaultError({absl::StrCat("cam_from_world.", name), "", "is required"}), field);
  };
  const v1::PinholeCamera& camera = proto.camera();
  ModelView view;
  view.camera = {camera.width(), camera.height(), camera.fx(),
                 camera.fy(),    camera.cx(),     camera.cy()};
  RETURN_IF_ERROR(AtField(CheckCamera(view), field));
  if (!proto.cam_from_world().has_rotation()) return required("rotation");
  if (!proto.cam_from_world().has_translation()) return required("translation");
  const v1::Quaternion& q = proto.cam_from_world().rotation();
  const v1::Vector3& t = proto.cam_from_world().translation();
  view.cam_from_world = {{q.w(), q.x(), q.y(), q.z()}, {t.x(), t.y(), t.z()}};
  RETURN_IF_ERROR(AtField(CheckView(view), field));
  // Decimals and single precision leave a small error of the norm.
  view.cam_from_world.rotation.normalize();
  return view;
}

std::vector<const v1::MaskImage*> ImagesOf(const v1::Prompt& prompt) {
  std::vector<const v1::MaskImage*> images;
  if (prompt.has_mask()) images.push_back(&prompt.mask());
  if (prompt.points().has_previous_mask()) images.push_back(&prompt.points().previous_mask());
  if (prompt.scribbles().has_positive()) images.push_back(&prompt.scribbles().positive());
  if (prompt.scribbles().has_negative()) images.push_back(&prompt.scribbles().negative());
  return images;
}

absl::StatusOr<Prompt> ToViewAt(const Frame& frame, Prompt prompt, const std::string& field) {
  auto in_view = frame.ToView(std::move(prompt));
  if (!in_view.ok()) return AtField(in_view.status(), field);
  return in_view;
}

absl::StatusOr<ModelView> FindView(const std::string& name, const Model& model,
                                   const std::string& field) {
  const auto found = std::find_if(model.views.begin(), model.views.end(),
                                  [&](const ModelView& view) { return view.name == name; });
  if (found == model.views.end()) return BadField(field, name, "not a view of the model");
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

absl::StatusOr<std::vector<ModelView>> FindTargets(const v1::SegmentViewsRequest::Targets& targets,
                                                   const Model& model) {
  const bool grouped = targets.group() != v1::SegmentViewsRequest::Targets::GROUP_UNSPECIFIED;
  // Refused rather than merged, since a client that sends both has made an error.
  if (grouped && !targets.views().empty()) {
    return BadField("targets", absl::StrCat(targets.views_size()), "views next to a group");
  }
  RETURN_IF_ERROR(AtField(CheckNumTargets(targets.views_size()), ""));
  std::vector<ModelView> views;
  switch (targets.group()) {
    case v1::SegmentViewsRequest::Targets::GROUP_UNSPECIFIED:
      break;
    case v1::SegmentViewsRequest::Targets::GROUP_ALL:
      return model.views;
    case v1::SegmentViewsRequest::Targets::GROUP_HELD_OUT:
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
  std::set<std::string> names;
  for (int i = 0; i < targets.views_size(); ++i) {
    // A view that is listed twice is answered once.
    if (!names.insert(targets.views(i)).second) continue;
    ASSIGN_OR_RETURN(ModelView view,
                     FindView(targets.views(i), model, absl::StrCat("targets.views[", i, "]")));
    views.push_back(std::move(view));
  }
  return views;
}

absl::StatusOr<Prompt> PromptOfLabel(const LabelRecord& label, const Model& model,
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
  const auto record = store_.labels().GetLabel(scene, id);
  if (!record.ok()) return WithResource(record.status(), "NO_SUCH_LABEL", LabelName(scene, id));
  return PromptOfLabel(*record, model_, number_);
}

absl::StatusOr<Prompt> SegmentRequestReader::ReadPrompt(const v1::Prompt& prompt,
                                                        ImageOfView image_of,
                                                        const std::string& field) const {
  if (prompt.what_case() == v1::Prompt::kLabel) {
    if (prompt.has_view()) return BadField(field + ".view", "", "a label has its own view");
    return ReadLabel(prompt.label(), field + ".label");
  }
  Prompt read;
  ASSIGN_OR_RETURN(read.view, FindViewpoint(prompt.view(), model_, field + ".view"));
  const Frame image = image_of(read.view);
  std::string of_shape = field;
  ASSIGN_OR_RETURN(read.what, ReadShape(prompt, image, of_shape));
  if (prompt.points().has_previous_mask()) {
    ASSIGN_OR_RETURN(read.previous, ReadMask(prompt.points().previous_mask(), image,
                                             absl::StrCat(of_shape, ".previous_mask")));
  }
  return ToViewAt(image, std::move(read), of_shape);
}

absl::StatusOr<Prompt> SegmentRequestReader::ReadPrompt(const v1::Prompt& prompt,
                                                        v1::PixelFrame frame) const {
  RETURN_IF_ERROR(CheckFrame(frame));
  const auto image_of = [&](const ModelView& view) {
    return Frame(view, FrameKindFromProto(frame));
  };
  return ReadPrompt(prompt, image_of, "prompt");
}

absl::StatusOr<Granularity> SegmentRequestReader::ReadGranularity(
    const v1::Granularity& granularity, const std::string& field) const {
  Granularity read;
  if (granularity.scale_case() == v1::Granularity::kScaleQuantile) {
    read.scale = granularity.scale_quantile();
  } else if (granularity.scale_case() == v1::Granularity::kScaleUnits) {
    const double units = granularity.scale_units();
    RETURN_IF_ERROR(AtField(CheckScaleUnits(units), field));
    // Inside, a scale is a quantile of the model's own scales; lengths are converted here.
    read.scale = QuantileOfScale(model_.field, units);
  }
  if (granularity.has_threshold()) read.threshold = granularity.threshold();
  RETURN_IF_ERROR(AtField(CheckGranularity(read), field));
  return read;
}

absl::StatusOr<SegmentRequest> SegmentRequestReader::Read(
    const v1::SegmentViewsRequest& request) const {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  SegmentRequest read;
  ASSIGN_OR_RETURN(read.prompt, ReadPrompt(request.prompt(), request.frame()));
  ASSIGN_OR_RETURN(read.granularity, ReadGranularity(request.granularity(), "granularity"));
  ASSIGN_OR_RETURN(read.targets, FindTargets(request.targets(), model_));
  // Without targets, the view of the prompt is segmented.
  if (read.targets.empty()) read.targets.push_back(read.prompt.view);
  read.frame = FrameKindFromProto(request.frame());
  read.options = {.want_similarity = request.want_similarity(),
                  .refine_borders = RefinesBorders(request)};
  return read;
}

absl::StatusOr<ProposeRequest> SegmentRequestReader::Read(
    const v1::ProposeScalesRequest& request) const {
  RETURN_IF_ERROR(CheckEncoding(request.mask_encoding()));
  ProposeRequest read;
  ASSIGN_OR_RETURN(read.prompt, ReadPrompt(request.prompt(), request.frame()));
  const int wanted = request.max_proposals();
  RETURN_IF_ERROR(AtField(CheckNumProposals(wanted), ""));
  if (wanted > 0) read.max_count = wanted;
  read.frame = FrameKindFromProto(request.frame());
  read.options = {.refine_borders = RefinesBorders(request)};
  return read;
}

}  // namespace pepeseg
