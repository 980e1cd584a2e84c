#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_poses.h"
#include "core/dataset/pixel_frame.h"
#include "core/dataset/view_warp.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"

namespace pepeseg {

// Warps depth maps of photographs to their views.
class DepthWarper {
 public:
  // Returns the prior of the view for a map of its photograph; an empty one for an empty map or one
  // without information. `file` is the map's, null without one.
  DepthPrior ToView(const DatasetFile* file, const FloatImage& map, const View& view,
                    const ViewWarp& warp);
  // Adds a warning that names the depth maps without information.
  void AddWarnings(std::vector<std::string>& warnings) const;

 private:
  std::vector<std::string> without_depth_;
};

struct ViewPriors {
  MaskSet masks;
  DepthPrior depth;
};
// Reads masks and depth of a view. `pixels` are those of its camera. Returns the errors of
// CompanionFiles.
absl::StatusOr<ViewPriors> ReadPriors(const View& view, const CameraPixels& pixels,
                                      const ViewWarp& warp, CompanionFiles& files,
                                      DepthWarper& depth);

// The pixel frames of a dataset's files where their sizes fit both.
struct DatasetFrames {
  PixelFrame cameras = PixelFrame::kStored;
  CompanionFrames companions;
};

// Reads the views of a dataset with their photographs, masks, depth and ignored pixels, one after
// the other.
class ViewReader {
 public:
  // The index and the poses must outlive it. image_scale: ImportOptions::image_scale.
  ViewReader(const DatasetIndex& index, const PhotoPoses& poses, DatasetFrames frames,
             double image_scale);

  // Returns INVALID_ARGUMENT, which names the file, for what cannot be read or does not fit.
  absl::StatusOr<View> Read(const Match& match);
  // Adds what was changed or left out so far.
  void AddWarnings(std::vector<std::string>& warnings) const;

 private:
  absl::Status PrepareWarp(uint32_t camera_id, const Lens& lens);
  absl::Status ReadCompanions(const CameraPixels& pixels, View& view);

  const PhotoPoses& poses_;
  PixelFrame camera_frame_;
  double image_scale_;
  CompanionFiles files_;
  DepthWarper depth_;
  int num_resized_ = 0;
  std::vector<std::string> turned_;
  std::optional<ViewWarp> warp_;
  uint32_t warp_camera_ = 0;
  Lens warp_lens_;
};

}  // namespace pepeseg
