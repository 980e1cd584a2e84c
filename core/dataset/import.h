#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/base/options.h"
#include "core/dataset/dataset_files.h"
#include "core/scene/capture.h"

namespace pepeseg {

struct ImportOptions {
  // Factor by which photographs and cameras are shrunk, by area averaging.
  double image_scale = 1.0;
  // Every n-th view by name is held out of training, beginning with the first. 0: none.
  int held_out_every = 8;
  // Names of the views that are held out, as in View.view, in place of every n-th. Empty:
  // held_out_every decides. Each is a photograph of the dataset.
  std::vector<std::string> held_out_views = {};
  // Whether the masks of the dataset are used. False: they are left out, with a warning, as if they
  // were not in the dataset; the option priors.masks then says what makes others. Ignore masks are
  // always used.
  bool use_masks = true;
  // Whether the depth and disparity maps of the dataset are used; as use_masks.
  bool use_depth = true;
};
// Passes each option with its range to `visit`.
void VisitOptions(ImportOptions& options, OptionVisitor visit);
// Returns INVALID_ARGUMENT, naming the option, if one is out of range.
absl::Status Validate(const ImportOptions& options);

// Runs the stage "prepare": decodes, checks and undistorts the files of a dataset.
//
// A mask or depth map belongs to the photograph whose name, without folder and suffix, is the same:
// masks/cam0/7.json to images/cam0/7.jpg. So does a folder of masks, masks/cam0/7/*.png. A view has
// the name of its photograph below images/
// ("cam0/7.jpg"), whether or not COLMAP's names have that folder.
//
// Where a photograph has an EXIF orientation, its camera, masks, ignore masks and depth may each be
// of the stored or of the upright pixels (pixel_frame.h). Sizes decide, else frame_choice.h; what
// was taken is in the warnings. If the camera is of the upright pixels, the view is made of the
// upright photograph, and its orientation is 1.
//
// Photographs without a pose, poses without a photograph, and depth maps without information are
// left out with a warning. INVALID_ARGUMENT, naming the file and, where there is one, the index,
// the field and the limit: a file is malformed, files contradict each other, or fewer than 2 views
// are usable, or options.held_out_views names no photograph. No memory is allocated for a count
// that a file declares but cannot hold. Gaussians are not read; there may be at most one file of
// them. Photographs are decoded on up to num_threads threads, 0: as many as the machine has; the
// capture does not depend on their number.
absl::StatusOr<Capture> ImportCapture(std::span<const DatasetFile> files,
                                      const ImportOptions& options, int num_threads = 0);

// Adds masks and depth maps that were made after the import to the views of `capture`, with the
// same result as an import that includes them, but without decoding the photographs again. Files
// whose size fits both pixel frames of a photograph are of its upright pixels. Returns warnings. On
// an error, which is as for ImportCapture, the capture stays unchanged.
absl::StatusOr<std::vector<std::string>> ImportPriors(std::span<const DatasetFile> files,
                                                      Capture& capture, int num_threads = 0);

// Which views of a dataset are held out of training (METHOD.md section 0).

// Returns INVALID_ARGUMENT if one of options.held_out_views is not in `photographs`, or if all of
// them are held out. The message names up to three photographs with a similar name. `photographs`
// are names of views, as PhotoKey returns them.
absl::Status CheckHeldOutViews(const ImportOptions& options,
                               std::span<const std::string> photographs);

// Returns true if the view is held out. `index` is its position among all views by name.
bool IsHeldOut(const ImportOptions& options, absl::string_view view, size_t index);

// Returns the number of views that are held out of `num_views`. A name that is given twice counts
// once.
int64_t NumHeldOut(const ImportOptions& options, int64_t num_views);

}  // namespace pepeseg
