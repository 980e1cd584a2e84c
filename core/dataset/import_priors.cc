#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/dataset/companion_files.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/depth_checks.h"
#include "core/dataset/import.h"
#include "core/dataset/match_poses.h"
#include "core/dataset/reading_notes.h"
#include "core/dataset/view_reader.h"
#include "core/dataset/view_warp.h"
#include "core/scene/camera.h"
#include "core/scene/capture.h"

namespace pepeseg {
namespace {

// Reads priors of imported views, of which most have the same lens. For one thread.
class PriorReader {
 public:
  explicit PriorReader(const CompanionFiles& files) : files_(&files) {}

  absl::StatusOr<ViewPriors> Read(const View& view) {
    const Photograph& photograph = *view.photograph;
    if (!warp_ || photograph_ != photograph || camera_ != view.camera) {
      warp_ = ViewWarp::Restore(photograph, view.camera);
      photograph_ = photograph;
      camera_ = view.camera;
    }
    const CameraPixels pixels{{view.name, photograph.lens.width, photograph.lens.height},
                              photograph.orientation,
                              PixelFrame::kStored};
    return ReadPriors(view, pixels, *warp_, *files_, notes_);
  }
  const ReadingNotes& notes() const { return notes_; }

 private:
  const CompanionFiles* files_;
  ReadingNotes notes_;
  std::optional<ViewWarp> warp_;  // of the photograph and the camera
  Photograph photograph_;
  Camera camera_;
};

}  // namespace

absl::StatusOr<std::vector<std::string>> ImportPriors(std::span<const DatasetFile> files,
                                                      Capture& capture, int num_threads) {
  std::vector<std::string> keys, warnings;
  for (const View& view : capture.views) keys.push_back(view.name);
  ASSIGN_OR_RETURN(const DatasetIndex index, IndexPriors(files, keys));
  RETURN_IF_ERROR(CheckCompanions(keys, index.masks, "mask files", warnings));
  RETURN_IF_ERROR(CheckCompanions(keys, index.depth, "depth maps", warnings));
  // Priors are made of upright copies of the photographs.
  const CompanionFiles companions(index, {{Companion::kMasks, PixelFrame::kUpright},
                                          {Companion::kDepth, PixelFrame::kUpright}});
  int64_t max_pixels = 0;
  for (const View& view : capture.views) {
    // Every imported view has a photograph.
    const Lens& lens = view.photograph->lens;
    max_pixels = std::max(max_pixels, int64_t{lens.width} * lens.height);
  }
  std::vector<PriorReader> readers(NumReaders(max_pixels, num_threads), PriorReader(companions));
  std::vector<ViewPriors> made(capture.views.size());
  RETURN_IF_ERROR(ReadEach(made.size(), static_cast<int>(readers.size()),
                           [&](size_t i, int reader) -> absl::Status {
                             ASSIGN_OR_RETURN(made[i], readers[reader].Read(capture.views[i]));
                             return absl::OkStatus();
                           }));
  ReadingNotes notes;
  for (const PriorReader& reader : readers) notes.Merge(reader.notes());
  std::vector<View*> with_depth;
  // Nothing can fail from here on, so the capture is changed completely or not at all.
  for (size_t i = 0; i < capture.views.size(); ++i) {
    View& view = capture.views[i];
    if (!made[i].masks.empty()) view.masks = std::move(made[i].masks);
    if (made[i].depth.values.empty()) continue;
    view.depth = std::move(made[i].depth);
    with_depth.push_back(&view);
  }
  notes.AddWarnings(warnings);
  for (std::string& warning : CorrectDepthKinds(with_depth, capture.points)) {
    warnings.push_back(std::move(warning));
  }
  return warnings;
}

}  // namespace pepeseg
