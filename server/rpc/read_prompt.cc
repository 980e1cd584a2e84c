#include "server/rpc/read_prompt.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/io/rle.h"
#include "core/scene/origin.h"
#include "core/status_macros.h"
#include "server/convert.h"
#include "server/rpc/error.h"
#include "server/rpc/read_mask.h"
#include "server/rpc/resource_name.h"

namespace pepeseg {

namespace {

// A mask of `from` pixels as an image of the view's size shows it.
BinaryMask Resampled(const BinaryMask& mask, const LabelRow& from, const Camera& to) {
  if (from.width == to.width && from.height == to.height) return mask;
  BinaryMask resampled;
  resampled.pixels.reserve(static_cast<size_t>(to.width) * to.height);
  for (int y = 0; y < to.height; ++y) {
    const int64_t row = (2 * int64_t{y} + 1) * from.height / (2 * int64_t{to.height});
    for (int x = 0; x < to.width; ++x) {
      const int64_t column = (2 * int64_t{x} + 1) * from.width / (2 * int64_t{to.width});
      resampled.pixels.push_back(mask.pixels[row * from.width + column]);
    }
  }
  return resampled;
}

// The id alone, or a whole name of a label of this scene.
absl::StatusOr<std::string> LabelId(const std::string& label, const std::string& scene,
                                    const std::string& field) {
  if (label.find('/') == std::string::npos) return label;
  ASSIGN_OR_RETURN(SceneLabel named, ParseLabelName(label, field));
  if (named.scene != scene) return BadField(field, label, "a label of another scene");
  return std::move(named.id);
}

absl::StatusOr<Prompt> ReadLabel(const ServiceContext& context, const ResidentModel& model,
                                 const std::string& label, const std::string& field) {
  ASSIGN_OR_RETURN(const SceneChild of, ParseModelName(model.name, "model"));
  ASSIGN_OR_RETURN(const std::string id, LabelId(label, of.scene, field));
  const auto row = context.store->GetLabel(of.scene, id);
  if (!row.ok()) return WithResource(row.status(), "NO_SUCH_LABEL", LabelName(of.scene, id));
  const std::vector<ModelView>& views = model.segmenter->model().views;
  const auto view = std::find_if(views.begin(), views.end(),
                                 [&](const ModelView& v) { return v.name == row->view; });
  if (view == views.end()) {
    return WithResource(absl::FailedPreconditionError(absl::StrCat(
                            "label ", id, " is of view ", row->view, ", which ", model.name,
                            " does not have: give the label again in one of its views")),
                        "NO_SUCH_VIEW", LabelName(of.scene, id));
  }
  ASSIGN_OR_RETURN(const std::vector<int64_t> counts, ParseCocoCounts(row->counts));
  ASSIGN_OR_RETURN(const std::vector<uint32_t> inside,
                   PixelsOfRuns(counts, row->width, row->height));
  BinaryMask mask = {std::vector<uint8_t>(static_cast<size_t>(row->width) * row->height)};
  for (const uint32_t pixel : inside) mask.pixels[pixel] = 1;
  return Prompt{*view, Resampled(mask, *row, view->camera)};
}

}  // namespace

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
      view.cam_from_world = RelativeTo(model.origin, view.cam_from_world);
      return view;
    }
    default:
      return BadField(field, "", "neither a view nor a free camera");
  }
}

absl::StatusOr<Prompt> ReadPrompt(const ServiceContext& context, const ResidentModel& model,
                                  const v1::Prompt& prompt, const std::string& field) {
  if (prompt.what_case() == v1::Prompt::kLabel) {
    if (prompt.has_view()) return BadField(field + ".view", "", "a label has its own view");
    return ReadLabel(context, model, prompt.label(), field + ".label");
  }
  Prompt read;
  ASSIGN_OR_RETURN(read.view,
                   FindViewpoint(prompt.view(), model.segmenter->model(), field + ".view"));
  switch (prompt.what_case()) {
    case v1::Prompt::kPoints: {
      ASSIGN_OR_RETURN(read.what, PointsFromProto(prompt.points()));
      return read;
    }
    case v1::Prompt::kBox: {
      const v1::BoxPrompt& box = prompt.box();
      read.what = BoxPrompt{box.x(), box.y(), box.width(), box.height()};
      return read;
    }
    case v1::Prompt::kMask: {
      ASSIGN_OR_RETURN(read.what, ReadMask(prompt.mask(), read.view, field + ".mask"));
      return read;
    }
    default:
      return BadField(field, "", "no points, box, mask or label");
  }
}

absl::StatusOr<Granularity> ReadGranularity(const v1::Granularity& granularity, const Model& model,
                                            const std::string& field) {
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
    read.scale = QuantileOfScale(model.field, units);
  }
  if (granularity.has_threshold()) {
    read.threshold = granularity.threshold();
    if (!(*read.threshold >= -1 && *read.threshold <= 1)) {
      return BadField(field + ".threshold", absl::StrCat(*read.threshold), "not in [-1, 1]");
    }
  }
  return read;
}

}  // namespace pepeseg
