#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/dataset/import.h"
#include "core/dataset/view_warp.h"
#include "core/priors/sam/prompted_segmenter.h"
#include "core/priors/sam/sam_embedding.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// A folder with a file of SAM's masks for each photograph, and one of its embedding. Masks are
// masks of the upright photograph, shrunk as the import shrinks it, so that they need neither pose
// nor lens. Thread-safe for calls with different photographs.
class PhotographMasks {
 public:
  PhotographMasks(std::filesystem::path folder, double image_scale)
      : folder_(std::move(folder)), image_scale_(image_scale) {}

  // Creates the folder.
  absl::Status Prepare() const;

  // Returns true if the photograph with this number has a file of masks that is not damaged.
  bool Has(size_t number, const DatasetFile& photograph) const;
  // Segments the photograph and writes its masks. Writes nothing and returns OK for a photograph
  // that does not decode, because that photograph gets no pose either. With an `origin`, also
  // writes the embedding, before the masks; one that cannot be written is left out.
  absl::Status Make(size_t number, const DatasetFile& photograph, PromptedSegmenter& segmenter,
                    const EmbeddingOrigin* origin = nullptr) const;
  // Returns the masks of a photograph of width x height upright pixels, or INVALID_ARGUMENT if
  // there are none.
  absl::StatusOr<MaskSet> Read(size_t number, int width, int height) const;

 private:
  std::filesystem::path File(size_t number) const;

  std::filesystem::path folder_;
  double image_scale_;
};

// Moves the files of the embeddings of these views' photographs from one folder to another, where
// they are kept. Returns how many there were.
int MoveEmbeddings(const std::filesystem::path& from, const std::vector<View>& views,
                   const std::filesystem::path& to);

// Warps masks of upright photographs to their imported views. Keeps the last warp, because most
// views have the same lens.
class MaskWarp {
 public:
  MaskSet ToView(const MaskSet& masks, const View& view);

 private:
  Photograph photograph_;
  std::optional<ViewWarp> warp_;
};

}  // namespace pepeseg
