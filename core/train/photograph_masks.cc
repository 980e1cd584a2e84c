#include "core/train/photograph_masks.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_index.h"
#include "core/dataset/mask_files.h"
#include "core/dataset/photo_file.h"
#include "core/dataset/pixel_frame.h"
#include "core/formats/rle.h"
#include "core/priors/sam/automatic_masks.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// Returns the warp that shrinks a photograph as the import does, but keeps its lens.
absl::StatusOr<ViewWarp> Shrinking(int width, int height, double image_scale) {
  // A pinhole without distortion: masks are made before the lens is known and warped to the view
  // later, see MaskWarp.
  return ViewWarp::Create({.width = width, .height = height}, image_scale);
}

// Writes masks as SAM's automatic mask generator does, which mask_files.h reads.
std::string ToSamJson(const MaskSet& masks) {
  nlohmann::json list = nlohmann::json::array();
  BinaryMask mask;
  for (const std::vector<PixelRun>& runs : RunsOfMasks(masks)) {
    mask.pixels.assign(static_cast<size_t>(masks.width) * masks.height, 0);
    for (const PixelRun& run : runs) {
      std::fill(mask.pixels.begin() + run.first, mask.pixels.begin() + run.last, uint8_t{1});
    }
    const std::string counts = EncodeCocoRle(mask, masks.width, masks.height);
    list.push_back({{"segmentation", {{"size", {masks.height, masks.width}}, {"counts", counts}}}});
  }
  return list.dump();
}

}  // namespace

fs::path PhotographMasks::File(size_t number) const {
  return folder_ / absl::StrFormat("upright%06d.json", number + 1);
}

absl::Status PhotographMasks::Prepare() const {
  std::error_code error;
  fs::create_directories(folder_, error);
  return error ? FileError(folder_, "create", error.value()) : absl::OkStatus();
}

// Reads the file completely, because a run that was interrupted or a disk may have damaged it.
// Links are not followed.
bool PhotographMasks::Has(size_t number, const DatasetFile& photograph) const {
  std::error_code ignored;
  if (!fs::is_regular_file(fs::symlink_status(File(number), ignored))) return false;
  const auto facts = ReadPhotoFacts(photograph);
  if (!facts.ok()) return false;
  const bool exchanged = facts->orientation >= 5;
  return exchanged ? Read(number, facts->height, facts->width).ok()
                   : Read(number, facts->width, facts->height).ok();
}

absl::StatusOr<MaskSet> PhotographMasks::Read(size_t number, int width, int height) const {
  ASSIGN_OR_RETURN(const ViewWarp shrink, Shrinking(width, height, image_scale_));
  const std::string name = File(number).filename().string();
  return ReadMasks(File(number), name, {name, shrink.camera().width, shrink.camera().height});
}

// Segments the shrunk photograph, so that masks are as large as those of the imported view. The
// full photograph is freed first, to save memory.
absl::Status PhotographMasks::Make(size_t number, const DatasetFile& photograph,
                                   PromptedSegmenter& segmenter,
                                   const EmbeddingOrigin* origin) const {
  absl::StatusOr<DecodedPhoto> decoded = ReadPhoto(photograph);
  // Not an error here: the import decodes the same file and reports it by name.
  if (!decoded.ok()) return absl::OkStatus();
  // SAM has learnt from upright pictures.
  Image photo = Upright(*std::move(decoded)).image;
  ASSIGN_OR_RETURN(const ViewWarp shrink, Shrinking(photo.width, photo.height, image_scale_));
  View view;
  view.photo = shrink.Photo(photo);
  photo.pixels = {};
  AutomaticMaskOptions options;
  options.join_embedded = false;
  ASSIGN_OR_RETURN(const AutomaticMasks made, SegmentPhotograph(segmenter, view, {}, options,
                                                                [] { return absl::OkStatus(); }));
  if (origin != nullptr) {
    const absl::StatusOr<SamEmbedding> embedding = segmenter.Embedding();
    if (absl::IsCancelled(embedding.status())) return embedding.status();
    // Without the file, who needs the embedding computes it again.
    if (embedding.ok()) {
      const fs::path file = folder_ / EmbeddingFileName(PhotoKey(photograph.name));
      WriteEmbedding(file, *embedding, *origin).IgnoreError();
    }
  }
  return WriteFileAtomically(File(number), ToSamJson(made.masks));
}

int MoveEmbeddings(const fs::path& from, const std::vector<View>& views, const fs::path& to) {
  int count = 0;
  std::error_code error;
  fs::create_directories(to, error);
  for (const View& view : views) {
    const std::string name = EmbeddingFileName(view.name);
    fs::rename(from / name, to / name, error);
    if (!error) ++count;
  }
  return count;
}

// The warp depends on the lens and the crop of the photograph and on the view's camera.
MaskSet MaskWarp::ToView(const MaskSet& masks, const View& view) {
  if (!warp_ || photograph_ != *view.photograph || warp_->camera() != view.camera) {
    photograph_ = *view.photograph;
    warp_ = ViewWarp::Restore(photograph_, view.camera);
  }
  return warp_->Masks(Turned(masks, InverseOrientation(photograph_.orientation)));
}

}  // namespace pepeseg
