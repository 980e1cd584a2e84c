#include "core/query/check_prompt.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

constexpr int kMaxSide = 16'384;
constexpr int64_t kMaxPixels = 64'000'000;
constexpr double kMinQuaternionNorm = 1e-6;

std::string NameOf(const ModelView& view) {
  return view.name.empty() ? "the free camera" : absl::StrCat("view ", view.name);
}

absl::Status CheckBetween(const std::string& what, double value, double low, double high) {
  if (value >= low && value <= high) return absl::OkStatus();  // false for NaN
  return absl::InvalidArgumentError(
      absl::StrCat(what, " is ", value, ", must be in [", low, ", ", high, "]"));
}

absl::Status CheckPoint(const Segmenter::Prompt& prompt, size_t index) {
  const PointPrompt& point = prompt.points[index];
  const Camera& camera = prompt.view.camera;
  if (point.x >= 0 && point.x < camera.width && point.y >= 0 && point.y < camera.height) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("point ", index, " is at (", point.x, ", ", point.y, "), outside of ",
                   NameOf(prompt.view), " of ", camera.width, "x", camera.height, " pixels"));
}

}  // namespace

absl::Status CheckView(const ModelView& view) {
  const Camera& c = view.camera;
  const std::string name = NameOf(view);
  if (c.width < 1 || c.height < 1 || c.width > kMaxSide || c.height > kMaxSide ||
      int64_t{c.width} * c.height > kMaxPixels) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": size is ", c.width, "x", c.height,
                                                   ", must be 1..", kMaxSide,
                                                   " a side and at most ", kMaxPixels, " pixels"));
  }
  constexpr double kMaxFocal = 1e7;
  RETURN_IF_ERROR(CheckBetween(absl::StrCat(name, ": fx"), c.fx, 1e-3, kMaxFocal));
  RETURN_IF_ERROR(CheckBetween(absl::StrCat(name, ": fy"), c.fy, 1e-3, kMaxFocal));
  RETURN_IF_ERROR(CheckBetween(absl::StrCat(name, ": cx"), c.cx, -kMaxFocal, kMaxFocal));
  RETURN_IF_ERROR(CheckBetween(absl::StrCat(name, ": cy"), c.cy, -kMaxFocal, kMaxFocal));
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

absl::Status CheckScale(double scale) { return CheckBetween("scale", scale, 0, 1); }

absl::Status CheckPrompt(const Segmenter::Prompt& prompt) {
  RETURN_IF_ERROR(CheckView(prompt.view));
  RETURN_IF_ERROR(CheckScale(prompt.scale));
  RETURN_IF_ERROR(CheckBetween("threshold", prompt.threshold, -1, 1));
  if (std::none_of(prompt.points.begin(), prompt.points.end(),
                   [](const PointPrompt& point) { return point.positive; })) {
    return absl::InvalidArgumentError("the prompt has no positive point");
  }
  constexpr size_t kMaxPoints = 256;
  if (prompt.points.size() > kMaxPoints) {
    return absl::InvalidArgumentError(absl::StrCat("the prompt has ", prompt.points.size(),
                                                   " points, must be at most ", kMaxPoints));
  }
  for (size_t i = 0; i < prompt.points.size(); ++i) RETURN_IF_ERROR(CheckPoint(prompt, i));
  return absl::OkStatus();
}

}  // namespace pepeseg
