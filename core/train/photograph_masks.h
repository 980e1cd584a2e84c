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

// Files with SAM's masks, one a photograph, in a folder. The masks are those of the photograph as
// its file stores it, shrunk as the import shrinks it: they need neither pose nor lens. Thread safe
// for calls of different photographs.
class PhotographMasks {
 public:
  PhotographMasks(std::filesystem::path folder, double image_scale)
      : folder_(std::move(folder)), image_scale_(image_scale) {}

  // Makes the folder.
  absl::Status Prepare() const;

  // Whether the masks of the photograph with this number are there; false for a damaged file.
  bool Has(size_t number, const DatasetFile& photograph) const;
  // Segments the photograph and writes its masks. For a photograph that does not decode it writes
  // nothing and returns OK: that photograph gets no pose either.
  absl::Status Make(size_t number, const DatasetFile& photograph,
                    PromptedSegmenter& segmenter) const;
  // The masks of a photograph of width x height pixels. INVALID_ARGUMENT: there are none.
  absl::StatusOr<MaskSet> Read(size_t number, int width, int height) const;

 private:
  std::filesystem::path File(size_t number) const;

  std::filesystem::path folder_;
  double image_scale_;
};

// Warps masks of photographs to their imported views. Keeps the last warp: most views have the same
// lens.
class MaskWarp {
 public:
  MaskSet ToView(const MaskSet& masks, const View& view);

 private:
  Photograph photograph_;
  std::optional<ViewWarp> warp_;
};

}  // namespace pepeseg
