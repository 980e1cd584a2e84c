#include "core/query/prompt.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr double kMinQuaternionNorm = 1e-6;
constexpr char kNothingThere[] = "pepeseg.core/nothing-there";  // type URL of the payload

std::string NameOf(const ModelView& view) {
  return view.name.empty() ? "the free camera" : absl::StrCat("view ", view.name);
}

absl::Status CheckPoint(const ModelView& view, const PointPrompt& point, size_t index) {
  const Camera& camera = view.camera;
  if (point.x >= 0 && point.x < camera.width && point.y >= 0 && point.y < camera.height) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("point ", index, " is at (", point.x, ", ",
                                                 point.y, "), outside of ", NameOf(view), " of ",
                                                 camera.width, "x", camera.height, " pixels"));
}

}  // namespace

absl::Status CheckView(const ModelView& view) {
  const Camera& c = view.camera;
  const std::string name = NameOf(view);
  if (c.width < 1 || c.height < 1 || c.width > kMaxViewSide || c.height > kMaxViewSide ||
      int64_t{c.width} * c.height > kMaxViewPixels) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": size is ", c.width, "x", c.height, ", must be 1..", kMaxViewSide,
                     " a side and at most ", kMaxViewPixels, " pixels"));
  }
  constexpr double kMaxFocal = 1e7;
  RETURN_IF_ERROR(CheckInRange(absl::StrCat(name, ": fx"), c.fx, 1e-3, kMaxFocal));
  RETURN_IF_ERROR(CheckInRange(absl::StrCat(name, ": fy"), c.fy, 1e-3, kMaxFocal));
  RETURN_IF_ERROR(CheckInRange(absl::StrCat(name, ": cx"), c.cx, -kMaxFocal, kMaxFocal));
  RETURN_IF_ERROR(CheckInRange(absl::StrCat(name, ": cy"), c.cy, -kMaxFocal, kMaxFocal));
  const Pose& pose = view.cam_from_world;
  const double norm = pose.rotation.norm();
  if (!std::isfinite(norm) || norm < kMinQuaternionNorm) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": the rotation's quaternion has norm ", norm, ", must be a rotation"));
  }
  if (!pose.translation.allFinite()) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": the translation is not finite"));
  }
  return absl::OkStatus();
}

absl::Status CheckScale(double scale) { return CheckInRange("scale", scale, 0.0, 1.0); }

absl::Status CheckThreshold(double threshold) {
  return CheckInRange("threshold", threshold, -1.0, 1.0);
}

absl::Status CheckPoints(const ModelView& view, std::span<const PointPrompt> points) {
  RETURN_IF_ERROR(CheckView(view));
  if (std::none_of(points.begin(), points.end(),
                   [](const PointPrompt& point) { return point.positive; })) {
    return absl::InvalidArgumentError("the prompt has no positive point");
  }
  if (points.size() > kMaxPromptPoints) {
    return absl::InvalidArgumentError(absl::StrCat("the prompt has ", points.size(),
                                                   " points, must be at most ", kMaxPromptPoints));
  }
  for (size_t i = 0; i < points.size(); ++i) RETURN_IF_ERROR(CheckPoint(view, points[i], i));
  return absl::OkStatus();
}

absl::Status CheckBox(const ModelView& view, const BoxPrompt& box) {
  RETURN_IF_ERROR(CheckView(view));
  const Camera& camera = view.camera;
  const bool finite = std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
                      std::isfinite(box.height);
  if (finite && box.width > 0 && box.height > 0 && box.x < camera.width && box.y < camera.height &&
      box.x + box.width > 0 && box.y + box.height > 0) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the box is at (", box.x, ", ", box.y, ") and has ", box.width, "x", box.height,
                   " pixels, must be finite, not empty and overlap ", NameOf(view), " of ",
                   camera.width, "x", camera.height, " pixels"));
}

absl::Status CheckMask(const ModelView& view, const BinaryMask& mask) {
  RETURN_IF_ERROR(CheckView(view));
  const auto num_pixels = static_cast<size_t>(view.camera.width) * view.camera.height;
  if (mask.pixels.size() != num_pixels) {
    return absl::InvalidArgumentError(absl::StrCat("the mask has ", mask.pixels.size(),
                                                   " pixels, must have the ", num_pixels, " of ",
                                                   NameOf(view)));
  }
  if (std::all_of(mask.pixels.begin(), mask.pixels.end(), [](uint8_t p) { return p == 0; })) {
    return absl::InvalidArgumentError("the mask of the prompt is empty");
  }
  return absl::OkStatus();
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

bool IsNothingThere(const absl::Status& status) {
  return status.GetPayload(kNothingThere).has_value();
}

}  // namespace pepeseg
