#include "server/rpc/read_prompt.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/convert.h"
#include "server/rpc/error.h"

namespace pepeseg {

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
    case v1::Viewpoint::kFree:
      return FreeViewFromProto(viewpoint.free(), field + ".free");
    default:
      return BadField(field, "", "neither a view nor a free camera");
  }
}

absl::StatusOr<Prompt> ReadPrompt(const v1::Prompt& prompt, const Model& model,
                                  const std::string& field) {
  Prompt read;
  ASSIGN_OR_RETURN(read.view, FindViewpoint(prompt.view(), model, field + ".view"));
  switch (prompt.what_case()) {
    case v1::Prompt::kPoints: {
      ASSIGN_OR_RETURN(read.what, PointsFromProto(prompt.points()));
      return read;
    }
    default:
      return BadField(field, "", "no points");
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
