#include "server/services/border_refiner.h"

#include <spdlog/spdlog.h>

#include <cstddef>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_facts.h"
#include "core/priors/sam/sam_networks.h"
#include "core/query/change_mask.h"
#include "server/api/error.h"
#include "server/services/stored_photographs.h"

namespace pepeseg {
namespace {

constexpr size_t kMostRecent = 32;                // views
constexpr int64_t kViewBytes = int64_t{4} << 20;  // of an embedding
// Of SAM's weights and their buffers, as measured (deploy/OPERATIONS.md).
constexpr int64_t kSamBytes = int64_t{350'000'000};

}  // namespace

absl::Status BorderRefiner::CheckAvailable() const {
  if (!options_.sam.empty()) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError("sam_borders: this server has no SAM, which its operator can "
                                    "install (deploy/sam.sh); leave the field out"),
      "NO_SAM", "sam");
}

// Loading takes a second: it is left to the first request. Clients do not learn the server's paths.
absl::Status BorderRefiner::OpenSam() {
  if (sam_ != nullptr) return absl::OkStatus();
  // Makes room by evicting models if it has to.
  constexpr int64_t kBytes = kSamBytes + int64_t{kMostRecent} * kViewBytes;
  ASSIGN_OR_RETURN(std::unique_ptr<ReservedMemory> memory,
                   options_.models.TakeServerMemory(kBytes));
  auto sam = SamBorders::Open(options_.sam, options_.num_threads);
  if (sam.ok()) {
    sam_ = *std::move(sam);
    memory_ = std::move(memory);
    spdlog::info("SAM is in memory, for borders of masks");
    return absl::OkStatus();
  }
  spdlog::error("sam_borders: {}", sam.status().ToString());
  if (absl::IsResourceExhausted(sam.status())) {
    return absl::ResourceExhaustedError("SAM does not fit into the server's memory");
  }
  return absl::FailedPreconditionError("SAM cannot be loaded: the server's log says why");
}

absl::StatusOr<Image> BorderRefiner::Photograph(const ResidentModel& model, const ModelView& view,
                                                absl::FunctionRef<bool()> wanted) const {
  if (view.name.empty() || !view.photograph) {
    return absl::NotFoundError("the view has no photograph");
  }
  StoredPhotographs photographs(options_.store, options_.blobs, options_.photographs, model.row,
                                wanted);
  ASSIGN_OR_RETURN(const DatasetFileRow file, photographs.Find(view));
  Model one;
  one.views = {view};
  PhotographTask task;
  task.name = file.path;
  task.sha256 = file.sha256;
  task.view = FormatModelFacts(one);
  task.max_side = kSamFrame;
  task.raw = true;
  return MakeImage(options_.photographs, task, photographs.PathOf(file), wanted);
}

absl::StatusOr<const BorderRefiner::Seen*> BorderRefiner::See(const ResidentModel& model,
                                                              const ModelView& view,
                                                              absl::FunctionRef<bool()> wanted) {
  Seen seen;
  // Not model.name: scenes of two projects may have one id.
  if (!view.name.empty()) {
    seen.key = absl::StrCat(model.row.scene, "/", model.row.number, "/", view.name);
  }
  for (auto at = recent_.begin(); at != recent_.end(); ++at) {
    if (seen.key.empty() || at->key != seen.key) continue;
    recent_.splice(recent_.begin(), recent_, at);
    return &recent_.front();
  }
  absl::StatusOr<Image> image = Photograph(model, view, wanted);
  if (absl::IsCancelled(image.status())) return image.status();
  seen.image = v1::SegmentViewsResponse::BORDER_IMAGE_PHOTOGRAPH;
  if (!image.ok()) {
    // Any other error leaves the rendering, and the answer says so.
    spdlog::debug("SAM: view {}: {}", view.name, image.status().ToString());
    ASSIGN_OR_RETURN(image, model.segmenter->RenderColor(view));
    seen.image = v1::SegmentViewsResponse::BORDER_IMAGE_RENDERING;
  }
  ASSIGN_OR_RETURN(seen.embedding, sam_->Embed(*image));
  recent_.push_front(std::move(seen));
  if (recent_.size() > kMostRecent) recent_.pop_back();
  return &recent_.front();
}

absl::StatusOr<v1::SegmentViewsResponse::BorderImage> BorderRefiner::Refine(
    const ResidentModel& model, const ModelView& view, absl::FunctionRef<bool()> wanted,
    SegmentResult& result) {
  const std::lock_guard lock(mutex_);
  if (!wanted()) return absl::CancelledError("nobody waits for the mask");
  RETURN_IF_ERROR(CheckAvailable());
  RETURN_IF_ERROR(OpenSam());
  ASSIGN_OR_RETURN(const Seen* seen, See(model, view, wanted));
  ASSIGN_OR_RETURN(BinaryMask mask,
                   sam_->Refine(seen->embedding, result.mask, result.width, result.height));
  SetMask(std::move(mask), result);
  return seen->image;
}

}  // namespace pepeseg
