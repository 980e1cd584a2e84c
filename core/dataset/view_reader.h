#pragma once

#include <cstdint>
#include <optional>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/photo_poses.h"
#include "core/dataset/pixel_frame.h"
#include "core/dataset/reading_notes.h"
#include "core/dataset/view_warp.h"
#include "core/scene/capture.h"
#include "core/scene/lens.h"

namespace pepeseg {

struct ViewPriors {
  MaskSet masks;
  DepthPrior depth;
};
// Reads masks and depth of a view, for its pixels. `pixels` are those of its camera. A depth map
// without information is left out, with a note. Returns the errors of CompanionFiles.
absl::StatusOr<ViewPriors> ReadPriors(const View& view, const CameraPixels& pixels,
                                      const ViewWarp& warp, const CompanionFiles& files,
                                      ReadingNotes& notes);

// The pixel frames of a dataset's files where their sizes fit both.
struct DatasetFrames {
  PixelFrame cameras = PixelFrame::kStored;
  CompanionFrames companions;
};

// Returns how many photographs are decoded at once on at most num_threads threads, 0: as many as
// the machine has, if the largest has max_pixels pixels: what is decoded together stays below about
// 128 megapixels.
int NumReaders(int64_t max_pixels, int num_threads);

// Calls read(i, reader) once for each i in [0, count) on several threads. No two calls at once have
// the same `reader`, in [0, num_readers). Returns the error of the least i whose call failed; calls
// after it may be left out.
absl::Status ReadEach(size_t count, int num_readers,
                      absl::FunctionRef<absl::Status(size_t i, int reader)> read);

// Reads the views of a dataset with their photographs, masks, depth and ignored pixels. Not thread
// safe: each thread has a reader of its own.
class ViewReader {
 public:
  // The index and the poses must outlive it. image_scale: ImportOptions::image_scale.
  ViewReader(const DatasetIndex& index, const PhotoPoses& poses, DatasetFrames frames,
             double image_scale);

  // Returns INVALID_ARGUMENT, which names the file, for what cannot be read or does not fit.
  absl::StatusOr<View> Read(const Match& match);
  // Returns the notes of all reads so far.
  const ReadingNotes& notes() const { return notes_; }

 private:
  absl::Status PrepareWarp(uint32_t camera_id, const Lens& lens);
  absl::Status ReadCompanions(const CameraPixels& pixels, View& view);

  const PhotoPoses& poses_;
  PixelFrame camera_frame_;
  double image_scale_;
  CompanionFiles files_;
  ReadingNotes notes_;
  std::optional<ViewWarp> warp_;
  uint32_t warp_camera_ = 0;
  Lens warp_lens_;
};

}  // namespace pepeseg
