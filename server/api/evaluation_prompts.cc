#include "server/api/evaluation_prompts.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/request_image.h"

namespace pepeseg {
namespace {

// Reads what is shown in one view.
class ShapeReader {
 public:
  ShapeReader(const TruthView& truth, const Frame& image) : truth_(truth), image_(image) {}

  // Everything but a label, which its caller reads.
  absl::StatusOr<PromptShape> Read(const v1::EntityPrompt& proto, const std::string& field) const {
    switch (proto.what_case()) {
      case v1::EntityPrompt::kPoints:
        return Points(proto.points(), field + ".points");
      case v1::EntityPrompt::kPointMean:
        return Mean(proto.point_mean(), field + ".point_mean");
      case v1::EntityPrompt::kScribbles:
        return Strokes(proto.scribbles(), field + ".scribbles");
      case v1::EntityPrompt::kBox:
        return InView<BoxPrompt>(BoxFromProto(proto.box()), field + ".box");
      case v1::EntityPrompt::kMask:
        return Mask(proto.mask(), field + ".mask");
      case v1::EntityPrompt::kOwnMask:
        if (truth_.IndexOf(proto.entity())) return OwnMask{};
        return BadField(field + ".own_mask", truth_.view.name, "has no mask of the entity");
      default:
        return BadField(field, "",
                        "no points, point_mean, scribbles, box, mask, own_mask or label_id");
    }
  }

 private:
  template <class Kind>
  absl::StatusOr<Kind> InView(Kind shape, const std::string& field) const {
    ASSIGN_OR_RETURN(Prompt prompt, ToViewAt(image_, {truth_.view, std::move(shape)}, field));
    return std::get<Kind>(std::move(prompt.what));
  }
  absl::StatusOr<PointsPrompt> Points(const v1::PointsPrompt& proto,
                                      const std::string& field) const {
    return InView<PointsPrompt>(PointsFromProto(proto), field);
  }
  absl::StatusOr<BinaryMask> Mask(const v1::MaskImage& proto, const std::string& field) const {
    ASSIGN_OR_RETURN(BinaryMask mask, ReadMask(proto, image_, field));
    return InView<BinaryMask>(std::move(mask), field);
  }
  absl::StatusOr<PointMean> Mean(const v1::PointsPrompt& proto, const std::string& field) const {
    ASSIGN_OR_RETURN(PointsPrompt points, Points(proto, field));
    for (size_t i = 0; i < points.size(); ++i) {
      if (points[i].positive) continue;
      return BadField(absl::StrCat(field, ".points[", i, "].negative"), "true",
                      "a mean has positive points only");
    }
    return PointMean{std::move(points)};
  }
  absl::StatusOr<Scribbles> Strokes(const v1::EntityPrompt::Scribbles& proto,
                                    const std::string& field) const {
    Scribbles scribbles;
    ASSIGN_OR_RETURN(scribbles.positive, Mask(proto.positive(), field + ".positive"));
    if (!proto.has_negative()) return scribbles;
    ASSIGN_OR_RETURN(scribbles.negative, Mask(proto.negative(), field + ".negative"));
    return scribbles;
  }

  const TruthView& truth_;
  const Frame& image_;
};

absl::StatusOr<const TruthView*> ViewOfPrompt(std::span<const TruthView> views,
                                              const std::string& name, const std::string& field) {
  const auto found = std::find_if(views.begin(), views.end(),
                                  [&](const TruthView& truth) { return truth.view.name == name; });
  if (found == views.end()) return BadField(field + ".view", name, "not a view of the request");
  return &*found;
}

absl::StatusOr<EntityPrompt> ReadOne(const v1::EntityPrompt& proto, v1::PixelFrame frame,
                                     std::span<const TruthView> views,
                                     const SegmentRequestReader& reader, const TruthFrames& frames,
                                     const std::string& field) {
  EntityPrompt prompt = {proto.entity(), proto.view(), {}};
  if (proto.what_case() == v1::EntityPrompt::kLabelId) {
    // Access is checked for the model alone, so a label is one of the model's scene.
    if (proto.label_id().find('/') != std::string::npos) {
      return BadField(field + ".label_id", proto.label_id(), "give the id of a label of the scene");
    }
    ASSIGN_OR_RETURN(const Prompt label, reader.ReadLabel(proto.label_id(), field + ".label_id"));
    if (!proto.view().empty() && proto.view() != label.view.name) {
      return BadField(field + ".view", proto.view(),
                      absl::StrCat("the label is of view \"", label.view.name, "\""));
    }
    prompt.view = label.view.name;
    RETURN_IF_ERROR(ViewOfPrompt(views, prompt.view, field).status());
    prompt.shape = std::get<BinaryMask>(label.what);
    return prompt;
  }
  ASSIGN_OR_RETURN(const TruthView* truth, ViewOfPrompt(views, prompt.view, field));
  const Frame image = frames.Image(truth->view, frame, TruthFrames::Kind::kPrompt);
  ASSIGN_OR_RETURN(prompt.shape, ShapeReader(*truth, image).Read(proto, field));
  return prompt;
}

}  // namespace

absl::StatusOr<std::vector<EntityPrompt>> ReadEntityPrompts(const v1::EvaluateModelRequest& request,
                                                            std::span<const TruthView> views,
                                                            const SegmentRequestReader& reader,
                                                            const TruthFrames& frames) {
  const bool makes_its_own = request.options().protocol() == v1::EVALUATION_PROTOCOL_CLICKS;
  if (makes_its_own && request.prompts_size() > 0) {
    return BadField("prompts", absl::StrCat(request.prompts_size()),
                    "prompts; the protocol CLICKS makes its own, give none");
  }
  std::set<std::string> known, seen;
  for (const TruthView& truth : views) known.insert(truth.entities.begin(), truth.entities.end());
  std::vector<EntityPrompt> prompts;
  for (int i = 0; i < request.prompts_size(); ++i) {
    const v1::EntityPrompt& proto = request.prompts(i);
    const std::string field = absl::StrCat("prompts[", i, "]");
    if (!known.contains(proto.entity())) {
      return BadField(field + ".entity", proto.entity(), "no view has a mask of this entity");
    }
    if (!seen.insert(proto.entity()).second) {
      return BadField(field + ".entity", proto.entity(), "has a prompt already");
    }
    ASSIGN_OR_RETURN(prompts.emplace_back(),
                     ReadOne(proto, request.frame(), views, reader, frames, field));
  }
  return prompts;
}

}  // namespace pepeseg
