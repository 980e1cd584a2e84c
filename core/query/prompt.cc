#include "core/query/prompt.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr char kNothingThere[] = "pepeseg.core/nothing-there";  // type URLs of payloads
constexpr char kFault[] = "pepeseg.core/fault";                 // PART \0 VALUE \0 LIMIT
constexpr absl::string_view kNul("\0", 1);

absl::Status BadPart(const std::string& part, const std::string& what) {
  return FaultError({part, "", what});
}

absl::Status CheckRange(const std::string& part, double value, double low, double high) {
  if (value >= low && value <= high) return absl::OkStatus();  // false for NaN
  return FaultError({part, absl::StrCat(value), absl::StrCat("not in [", low, ", ", high, "]")});
}

absl::Status CheckFinite(const std::string& part, double value) {
  if (std::isfinite(value)) return absl::OkStatus();
  return BadPart(part, absl::StrCat(value, " is not finite"));
}

absl::Status CheckInside(const PromptImage& image, double x, double y, const std::string& part) {
  if (x >= 0 && x < image.width && y >= 0 && y < image.height) return absl::OkStatus();
  if (!std::isfinite(x) || !std::isfinite(y)) {
    return BadPart(part, absl::StrCat("(", x, ", ", y, ") is not finite"));
  }
  return FaultError({part, absl::StrCat("point ", x, ",", y),
                     absl::StrCat("is outside ", image.name, " (", image.Size(), ")")});
}

absl::Status CheckUserPoints(const PromptImage& image, const PointsPrompt& points,
                             bool has_previous = false) {
  if (!points.empty() && points.size() <= kMaxPromptPoints) {
    return CheckPoints(image, points, has_previous);
  }
  return BadPart("points",
                 absl::StrCat(points.size(), " points, allowed are 1..", kMaxPromptPoints));
}

absl::Status CheckMean(const PromptImage& image, const PointsPrompt& points) {
  RETURN_IF_ERROR(CheckUserPoints(image, points));
  for (size_t i = 0; i < points.size(); ++i) {
    if (points[i].positive) continue;
    return FaultError(
        {absl::StrCat("points[", i, "].negative"), "true", "a mean has positive points only"});
  }
  return absl::OkStatus();
}

absl::Status CheckScribbles(const PromptImage& image, const Scribbles& scribbles) {
  if (scribbles.positive.pixels.empty()) return BadPart("", "no positive stroke among them");
  RETURN_IF_ERROR(CheckMask(image, scribbles.positive));
  if (scribbles.negative.pixels.empty()) return absl::OkStatus();
  return CheckMask(image, scribbles.negative);
}

absl::Status CheckPose(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const std::string rotation = "cam_from_world.rotation",
                    translation = "cam_from_world.translation";
  for (const auto& [name, value] :
       {std::pair{".w", q.w()}, {".x", q.x()}, {".y", q.y()}, {".z", q.z()}}) {
    RETURN_IF_ERROR(CheckFinite(rotation + name, value));
  }
  if (!(std::abs(q.norm() - 1) <= kMaxNormError)) {
    return BadPart(rotation,
                   absl::StrCat("norm ", q.norm(), " instead of 1 within ", kMaxNormError));
  }
  const Eigen::Vector3d& t = pose.translation;
  for (const auto& [name, value] : {std::pair{".x", t.x()}, {".y", t.y()}, {".z", t.z()}}) {
    RETURN_IF_ERROR(CheckFinite(translation + name, value));
  }
  return absl::OkStatus();
}

}  // namespace

std::string PromptImage::Size() const { return absl::StrCat(width, "x", height); }

PromptImage ImageOf(const ModelView& view) {
  return {view.name.empty() ? "the free camera" : absl::StrCat("view \"", view.name, "\""),
          view.camera.width, view.camera.height};
}

absl::Status FaultError(const PromptFault& fault) {
  std::string message = absl::StrCat(fault.value, " ", fault.limit);
  if (fault.is_number() && !fault.part.empty())
    message = absl::StrCat(fault.part, " is ", fault.value, ", ", fault.limit);
  if (fault.value.empty()) {
    message = absl::StrCat(fault.part, fault.part.empty() ? "" : ": ", fault.limit);
  }
  absl::Status status = absl::InvalidArgumentError(message);
  status.SetPayload(kFault,
                    absl::Cord(absl::StrCat(fault.part, kNul, fault.value, kNul, fault.limit)));
  return status;
}

std::optional<PromptFault> FaultOf(const absl::Status& status) {
  const absl::optional<absl::Cord> payload = status.GetPayload(kFault);
  if (!payload) return std::nullopt;
  const std::vector<std::string> parts = absl::StrSplit(std::string(*payload), kNul);
  return PromptFault{parts[0], parts[1], parts[2]};
}

absl::Status CheckCamera(const ModelView& view) {
  const Camera& c = view.camera;
  const int64_t most = view.name.empty() ? kMaxFreePixels : kMaxViewPixels;
  if (c.width < 1 || c.height < 1 || c.width > kMaxViewSide || c.height > kMaxViewSide ||
      int64_t{c.width} * c.height > most) {
    return BadPart("camera", absl::StrCat(c.width, " x ", c.height, " pixels, allowed are 1..",
                                          kMaxViewSide, " each and ", most, " in all"));
  }
  constexpr double kMinFocal = 1e-3, kMaxFocal = 1e7;
  RETURN_IF_ERROR(CheckRange("camera.fx", c.fx, kMinFocal, kMaxFocal));
  RETURN_IF_ERROR(CheckRange("camera.fy", c.fy, kMinFocal, kMaxFocal));
  RETURN_IF_ERROR(CheckRange("camera.cx", c.cx, -kMaxFocal, kMaxFocal));
  return CheckRange("camera.cy", c.cy, -kMaxFocal, kMaxFocal);
}

absl::Status CheckView(const ModelView& view) {
  RETURN_IF_ERROR(CheckCamera(view));
  return CheckPose(view.cam_from_world);
}

absl::Status CheckScale(double scale) { return CheckRange("scale_quantile", scale, 0, 1); }

absl::Status CheckThreshold(double threshold) { return CheckRange("threshold", threshold, -1, 1); }

absl::Status CheckScaleUnits(double scale_units) {
  if (std::isfinite(scale_units) && scale_units > 0) return absl::OkStatus();
  return FaultError({"scale_units", absl::StrCat(scale_units), "not finite and > 0"});
}

absl::Status CheckNumTargets(int num_targets) {
  if (num_targets <= kMaxTargets) return absl::OkStatus();
  return FaultError({"targets.views", absl::StrCat(num_targets),
                     absl::StrCat("views; allowed are ", kMaxTargets)});
}

absl::Status CheckNumProposals(int num_proposals) {
  return CheckRange("max_proposals", num_proposals, 0, kMaxProposals);
}

absl::Status CheckNumVoting(int num_views) {
  return CheckRange("num_views", num_views, 0, kMaxVotingViews);
}

absl::Status CheckMaskBytes(size_t num_bytes) {
  if (num_bytes <= kMaxMaskBytes) return absl::OkStatus();
  return FaultError(
      {"", absl::StrCat(num_bytes), absl::StrCat("bytes; allowed are ", kMaxMaskBytes)});
}

absl::Status CheckGranularity(const Granularity& granularity) {
  if (granularity.scale) RETURN_IF_ERROR(CheckScale(*granularity.scale));
  if (!granularity.threshold) return absl::OkStatus();
  return CheckThreshold(*granularity.threshold);
}

absl::Status CheckPoints(const PromptImage& image, std::span<const PointPrompt> points,
                         bool has_previous) {
  for (size_t i = 0; i < points.size(); ++i) {
    RETURN_IF_ERROR(CheckInside(image, points[i].x, points[i].y, absl::StrCat("points[", i, "]")));
  }
  // Negative points only take away from what positive ones, or the previous mask, select.
  const bool any_positive =
      has_previous || std::any_of(points.begin(), points.end(),
                                  [](const PointPrompt& point) { return point.positive; });
  return any_positive ? absl::OkStatus() : BadPart("points", "no positive point among them");
}

absl::Status CheckBox(const PromptImage& image, const BoxPrompt& box) {
  PromptFault fault = {"", absl::StrCat("box ", box.x, ",", box.y, " ", box.width, "x", box.height),
                       ""};
  const bool finite = std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
                      std::isfinite(box.height);
  // A box may reach over the border, as one that is drawn by hand does, but not lie outside.
  if (!finite || box.width <= 0 || box.height <= 0) {
    fault.limit = "is not finite, or is empty";
  } else if (box.x >= image.width || box.y >= image.height || box.x + box.width <= 0 ||
             box.y + box.height <= 0) {
    fault.limit = absl::StrCat("is outside ", image.name, " (", image.Size(), ")");
  } else {
    return absl::OkStatus();
  }
  return FaultError(fault);
}

absl::Status CheckMask(const PromptImage& image, const BinaryMask& mask) {
  const auto num_pixels = static_cast<size_t>(image.width) * image.height;
  if (mask.pixels.size() == num_pixels) return CheckNotEmpty(mask);
  return BadPart("", absl::StrCat("the mask has ", mask.pixels.size(), " pixels, must have the ",
                                  num_pixels, " of ", image.name));
}

absl::Status CheckStrokes(const PromptImage& image, std::span<const Stroke> strokes) {
  size_t num_vertices = 0;
  double num_pixels = 0;
  for (size_t i = 0; i < strokes.size(); ++i) {
    const Stroke& stroke = strokes[i];
    const std::string part = absl::StrCat("strokes[", i, "]");
    RETURN_IF_ERROR(CheckRange(part + ".width", stroke.width, 0, kMaxStrokeWidth));
    if (stroke.path.empty()) return BadPart(part + ".path", "has no vertex");
    num_vertices += stroke.path.size();
    for (size_t v = 0; v < stroke.path.size(); ++v) {
      const Eigen::Vector2d& at = stroke.path[v];
      RETURN_IF_ERROR(CheckInside(image, at.x(), at.y(), absl::StrCat(part, ".path[", v, "]")));
      const double length = v == 0 ? 0 : (at - stroke.path[v - 1]).norm();
      num_pixels += (length + 1) * (stroke.width + 1);
    }
  }
  if (num_vertices > kMaxVertices) {
    return BadPart("strokes", absl::StrCat(num_vertices, " vertices, allowed are ", kMaxVertices));
  }
  if (num_pixels <= kMaxStrokePixels) return absl::OkStatus();
  return BadPart("strokes",
                 absl::StrCat("cover ", static_cast<int64_t>(num_pixels), " pixels, allowed are ",
                              static_cast<int64_t>(kMaxStrokePixels)));
}

const BinaryMask* MaskOf(const Shape& shape) {
  return std::visit(Overloaded{[](const BinaryMask& mask) { return &mask; },
                               [](const Scribbles& scribbles) { return &scribbles.positive; },
                               [](const PointsPrompt&) -> const BinaryMask* { return nullptr; },
                               [](const PointMean&) -> const BinaryMask* { return nullptr; },
                               [](const BoxPrompt&) -> const BinaryMask* { return nullptr; }},
                    shape);
}

const PointsPrompt* PointsOf(const Shape& shape) {
  return std::visit(Overloaded{[](const PointsPrompt& points) { return &points; },
                               [](const PointMean& mean) { return &mean.points; },
                               [](const BoxPrompt&) -> const PointsPrompt* { return nullptr; },
                               [](const BinaryMask&) -> const PointsPrompt* { return nullptr; },
                               [](const Scribbles&) -> const PointsPrompt* { return nullptr; }},
                    shape);
}

absl::Status CheckShape(const PromptImage& image, const Shape& shape) {
  return std::visit(
      Overloaded{[&](const PointsPrompt& points) { return CheckUserPoints(image, points); },
                 [&](const BoxPrompt& box) { return CheckBox(image, box); },
                 [&](const BinaryMask& mask) { return CheckMask(image, mask); },
                 [&](const Scribbles& scribbles) { return CheckScribbles(image, scribbles); },
                 [&](const PointMean& mean) { return CheckMean(image, mean.points); }},
      shape);
}

absl::Status CheckShown(const PromptImage& image, const Prompt& prompt) {
  if (!prompt.previous) return CheckShape(image, prompt.what);
  const auto* const points = std::get_if<PointsPrompt>(&prompt.what);
  if (points == nullptr) return BadPart("previous_mask", "is for points");
  RETURN_IF_ERROR(CheckUserPoints(image, *points, /*has_previous=*/true));
  return CheckMask(image, *prompt.previous);
}

absl::Status CheckNotEmpty(const BinaryMask& mask) {
  // An empty mask selects nothing, and its mean feature would be undefined.
  if (std::ranges::any_of(mask.pixels, [](uint8_t pixel) { return pixel != 0; })) {
    return absl::OkStatus();
  }
  return BadPart("", "no pixel is in the mask");
}

absl::Status CheckQuery(const Query& query) {
  RETURN_IF_ERROR(CheckScale(query.scale));
  RETURN_IF_ERROR(CheckThreshold(query.threshold));
  if (query.features.size() != query.positive.size() * kFeatureSize) {
    return absl::InvalidArgumentError(absl::StrCat(query.features.size(), " feature values for ",
                                                   query.positive.size(), " features"));
  }
  if (std::none_of(query.positive.begin(), query.positive.end(),
                   [](uint8_t positive) { return positive != 0; })) {
    return absl::InvalidArgumentError("the query has no positive feature");
  }
  return absl::OkStatus();
}

absl::Status NothingThereError(absl::string_view message) {
  absl::Status status = absl::InvalidArgumentError(message);
  status.SetPayload(kNothingThere, absl::Cord());
  return status;
}

absl::Status NothingThereError(const PromptFault& fault) {
  absl::Status status = FaultError(fault);
  status.SetPayload(kNothingThere, absl::Cord());
  return status;
}

bool IsNothingThere(const absl::Status& status) {
  return status.GetPayload(kNothingThere).has_value();
}

}  // namespace pepeseg
