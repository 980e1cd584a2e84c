#include "core/scene/photograph.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using Eigen::Vector2d;

// How stored pixels become upright: the axes are swapped first, then mirrored.
struct Turn {
  bool swap, mirror_x, mirror_y;
};

// Indexed by orientation; 0 does not occur. The comments are EXIF 2.3's: the sides of the upright
// photograph at which the first stored scanline and column are.
constexpr Turn kTurns[] = {
    {},
    {false, false, false},  // 1: top, left
    {false, true, false},   // 2: top, right
    {false, true, true},    // 3: bottom, right
    {false, false, true},   // 4: bottom, left
    {true, false, false},   // 5: left, top
    {true, true, false},    // 6: right, top
    {true, true, true},     // 7: right, bottom
    {true, false, true},    // 8: left, bottom
};

}  // namespace

int Photograph::UprightWidth() const { return kTurns[orientation].swap ? lens.height : lens.width; }

int Photograph::UprightHeight() const {
  return kTurns[orientation].swap ? lens.width : lens.height;
}

Vector2d Photograph::ToUpright(const Vector2d& stored) const {
  const Turn& turn = kTurns[orientation];
  Vector2d place = stored;
  if (turn.swap) std::swap(place.x(), place.y());
  if (turn.mirror_x) place.x() = UprightWidth() - place.x();
  if (turn.mirror_y) place.y() = UprightHeight() - place.y();
  return place;
}

// Undoes the steps of ToUpright in reverse order.
Vector2d Photograph::ToStored(const Vector2d& upright) const {
  const Turn& turn = kTurns[orientation];
  Vector2d place = upright;
  if (turn.mirror_x) place.x() = UprightWidth() - place.x();
  if (turn.mirror_y) place.y() = UprightHeight() - place.y();
  if (turn.swap) std::swap(place.x(), place.y());
  return place;
}

absl::Status Validate(const Photograph& photograph) {
  RETURN_IF_ERROR(Validate(photograph.lens));
  if (photograph.orientation < 1 || photograph.orientation > 8) {
    return absl::InvalidArgumentError(
        absl::StrCat("the orientation ", photograph.orientation, " is outside of 1 to 8"));
  }
  // Written as differences, so that the sums cannot overflow.
  const Lens& lens = photograph.lens;
  if (photograph.left < 0 || photograph.top < 0 || photograph.width < 1 || photograph.height < 1 ||
      photograph.width > lens.width - photograph.left ||
      photograph.height > lens.height - photograph.top) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the part of ", photograph.width, "x", photograph.height, " pixels at ", photograph.left,
        ",", photograph.top, " is empty or outside of ", lens.width, "x", lens.height));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
