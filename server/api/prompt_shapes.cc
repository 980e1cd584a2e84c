#include "server/api/prompt_shapes.h"

#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

// Makes INVALID_ARGUMENT such as "point 700,500 is outside photograph "a.jpg" (640x480)".
absl::Status BadPlace(const std::string& field, const std::string& value, const std::string& what,
                      const char* reason = "BAD_FIELD") {
  return WithDetail(absl::InvalidArgumentError(absl::StrCat(value, " ", what)),
                    {.reason = reason, .field = field, .limit = what, .value = value});
}

// Makes the error of a prompt inside the photograph but outside the undistorted view. Clients may
// catch it by its reason: the click was valid, but the model cannot know what is there.
absl::Status NotShown(const std::string& field, const std::string& value,
                      const ImageOfView& image) {
  return BadPlace(
      field, value,
      absl::StrCat("is in a part of ", image.name, " (", image.Size(),
                   ") that the model was not trained on: its lens was undistorted and the ",
                   "border cut off"),
      "NOTHING_THERE");
}

}  // namespace

absl::StatusOr<std::vector<PointPrompt>> ReadPoints(const v1::PointsPrompt& prompt,
                                                    const ImageOfView& image,
                                                    const std::string& field) {
  ASSIGN_OR_RETURN(std::vector<PointPrompt> points, PointsFromProto(prompt, field));
  for (size_t i = 0; i < points.size(); ++i) {
    PointPrompt& point = points[i];
    const std::string of_point = absl::StrCat(field, ".points[", i, "]");
    const std::string value = absl::StrCat("point ", point.x, ",", point.y);
    if (point.x < 0 || point.x >= image.frame.width() || point.y < 0 ||
        point.y >= image.frame.height()) {
      return BadPlace(of_point, value,
                      absl::StrCat("is outside ", image.name, " (", image.Size(), ")"));
    }
    // The frame is the view: its pixels are those of the prompt.
    if (image.frame.is_view()) continue;
    const auto in_view = image.frame.ToView(Eigen::Vector2d(point.x, point.y));
    if (!in_view) return NotShown(of_point, value, image);
    point.x = in_view->x();
    point.y = in_view->y();
  }
  return points;
}

absl::StatusOr<BoxPrompt> ReadBox(const v1::BoxPrompt& prompt, const ImageOfView& image,
                                  const std::string& field) {
  const BoxPrompt box{prompt.x(), prompt.y(), prompt.width(), prompt.height()};
  const std::string value =
      absl::StrCat("box ", box.x, ",", box.y, " ", box.width, "x", box.height);
  const bool finite = std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
                      std::isfinite(box.height);
  if (!finite || box.width <= 0 || box.height <= 0) {
    return BadPlace(field, value, "is not finite, or is empty");
  }
  // A box may reach over the border, as one that is drawn by hand does, but not lie outside.
  if (box.x >= image.frame.width() || box.y >= image.frame.height() || box.x + box.width <= 0 ||
      box.y + box.height <= 0) {
    return BadPlace(field, value, absl::StrCat("is outside ", image.name, " (", image.Size(), ")"));
  }
  if (image.frame.is_view()) return box;
  const std::optional<BoxPrompt> in_view = image.frame.ToView(box);
  if (!in_view) return NotShown(field, value, image);
  return *in_view;
}

}  // namespace pepeseg
