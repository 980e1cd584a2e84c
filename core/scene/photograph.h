#pragma once

#include <Eigen/Core>

#include "absl/status/status.h"
#include "core/scene/lens.h"

namespace pepeseg {

// The uploaded photograph that a view was made of, and how pixels of the two correspond.
//
// A photograph has two pixel frames. "Stored" is the order of the file: poses, masks and training
// use it, unless the import has turned the photograph upright because its camera is of the upright
// pixels (import.h): its upright pixels then count as the stored ones. "Upright" is the frame after the EXIF orientation, as viewers show the photograph:
// requests and responses use it (PIXEL_FRAME_PHOTOGRAPH).
struct Photograph {
  Lens lens;            // of the stored pixels, at the size of the upload
  // EXIF orientation, [1, 8]. 1: stored pixels are upright, or count as such though the file has
  // another orientation.
  int orientation = 1;
  // The rectangle that the view shows, in pixels of the undistorted photograph: a pinhole with the
  // focal lengths, principal point and size of `lens`.
  int left = 0, top = 0, width = 0, height = 0;

  // Size of the upright photograph, pixels.
  int UprightWidth() const;
  int UprightHeight() const;
  // Converts a position in pixels from the stored to the upright frame, and back.
  Eigen::Vector2d ToUpright(const Eigen::Vector2d& stored) const;
  Eigen::Vector2d ToStored(const Eigen::Vector2d& upright) const;

  bool operator==(const Photograph&) const = default;
};

// Returns INVALID_ARGUMENT if the lens is invalid, the orientation is outside of [1, 8], or the
// rectangle is empty or not inside width x height of the lens.
absl::Status Validate(const Photograph& photograph);

}  // namespace pepeseg
