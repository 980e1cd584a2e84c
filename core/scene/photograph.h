#pragma once

#include <Eigen/Core>

#include "absl/status/status.h"
#include "core/scene/lens.h"

namespace pepeseg {

// The uploaded photograph that a view was made of.
//
// Its pixels come in two orders: as the file stores them, which poses, masks and training use, and
// upright, as viewers show them and as requests and answers count them (PIXEL_FRAME_PHOTOGRAPH).
struct Photograph {
  Lens lens;            // of the stored pixels, at the photograph's own size
  int orientation = 1;  // EXIF, [1, 8]: how stored pixels become upright; 1: they are
  // The part of the lens's frame, as of a pinhole of its focal lengths, that the view shows:
  // pixels.
  int left = 0, top = 0, width = 0, height = 0;

  // Size of the upright photograph, pixels.
  int UprightWidth() const;
  int UprightHeight() const;
  // A place, pixels, of the upright photograph from one of the stored pixels, and back.
  Eigen::Vector2d ToUpright(const Eigen::Vector2d& stored) const;
  Eigen::Vector2d ToStored(const Eigen::Vector2d& upright) const;

  bool operator==(const Photograph&) const = default;
};

// INVALID_ARGUMENT: as for the lens; an orientation that EXIF does not have; a part that is empty
// or outside of the frame.
absl::Status Validate(const Photograph& photograph);

}  // namespace pepeseg
