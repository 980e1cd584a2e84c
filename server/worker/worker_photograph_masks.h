#pragma once

#include <filesystem>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/dataset/view_warp.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// Files with the masks of photographs that SAM has segmented, in a job's folder. Masks are of the
// photograph as its file stores it, shrunk as the import shrinks it: they need no pose and no lens.
// Several threads may use it at the same time, for different photographs.
class PhotographMasks {
 public:
  PhotographMasks(std::filesystem::path folder, double image_scale)
      : folder_(std::move(folder)), image_scale_(image_scale) {}

  // Makes the folder.
  absl::Status Prepare() const;

  // Whether there are masks of the photograph with this number. A damaged file is as none.
  bool Has(size_t number, const DatasetFile& photograph) const;
  // Segments the photograph and keeps its masks. A photograph that does not decode gets none, and
  // that is no error: it gets no pose either.
  absl::Status Make(size_t number, const DatasetFile& photograph,
                    PromptedSegmenter& segmenter) const;
  // The masks of a photograph of width x height pixels. INVALID_ARGUMENT: there are none.
  absl::StatusOr<MaskSet> Read(size_t number, int width, int height) const;

 private:
  std::filesystem::path File(size_t number) const;

  std::filesystem::path folder_;
  double image_scale_;
};

// Takes masks of photographs to their views, which an import has made and most of which have one
// lens.
class MaskWarp {
 public:
  MaskSet ToView(const MaskSet& masks, const View& view);

 private:
  Photograph photograph_;
  std::optional<ViewWarp> warp_;
};

}  // namespace pepeseg
