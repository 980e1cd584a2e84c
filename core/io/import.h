#pragma once

#include <filesystem>

#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// The "prepare" stage: a dataset folder as users bring it, decoded and undistorted.
//   images/            JPEG, PNG or WebP photographs; names may hold subfolders
//   sparse/0/          COLMAP cameras, images, points3D, .bin or .txt (also accepted: sparse/, .)
//   masks/STEM.json    SAM automatic masks (COCO RLE), or masks/STEM.png label image (0 = none)
//   ignore_mask.png    one for all views, or ignore/STEM.png: non-zero = leave out
struct ImportOptions {
  double image_scale = 1.0;  // (0, 1]: photographs and cameras are shrunk by this, area-averaged
  int held_out_every = 8;    // every n-th view by name is held out, from the first; 0: none
};
absl::Status Validate(const ImportOptions& options);

// INVALID_ARGUMENT names the file, and the index, the field and the limit where there is one. No
// allocation follows a count that a file only claims. Photographs that the poses do not list (and
// poses without a photograph) are left out with a warning; fewer than 2 usable views is an error.
absl::StatusOr<Capture> ImportCapture(const std::filesystem::path& folder,
                                      const ImportOptions& options);

}  // namespace pepeseg
