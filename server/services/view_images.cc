#include "server/services/view_images.h"

#include <spdlog/spdlog.h>

#include <cstddef>
#include <cstdint>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_version.h"
#include "server/api/error.h"
#include "server/services/kept_embedding.h"
#include "server/services/stored_photographs.h"

namespace pepeseg {
namespace {

constexpr size_t kMostRecent = 32;                // views
constexpr int64_t kViewBytes = int64_t{2} << 20;  // of an embedding
// SAM's weights and their buffers on the CPU, bytes, as measured (deploy/OPERATIONS.md). Also
// reserved where a GPU computes, because the CPU takes over if that fails.
constexpr int64_t kSamBytes = int64_t{350'000'000};

// Returns NOT_FOUND unless the view has a photograph that shows the model.
absl::Status CheckPhotograph(const ResidentModel& model, const ModelView& view) {
  if (view.name.empty() || !view.photograph) {
    return absl::NotFoundError("the view has no photograph");
  }
  return IsEdited(model->model()) ? absl::NotFoundError("photographs do not show an edited model")
                                  : absl::OkStatus();
}

}  // namespace

absl::Status ViewImages::CheckAvailable(absl::string_view remedy) const {
  if (!deps_.sam.empty()) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          "this server has no SAM, which its operator can install (deploy/sam.sh); ", remedy)),
      "NO_SAM", "sam");
}

// Takes the memory for SAM on the GPU or, where that has no room, on the CPU alone. Evicts models
// that are not in use if it has to. `options` gets the GPU.
absl::StatusOr<std::unique_ptr<ReservedMemory>> ViewImages::TakeMemory(SamOptions& options) {
  MemoryBytes bytes = {kSamBytes + int64_t{kMostRecent} * kViewBytes, 0};
  if (deps_.cuda_device) {
    bytes.device = SamDeviceBytes(int64_t{kSamFrame} * kSamFrame);
    auto taken = deps_.models.TakeServerMemory(bytes);
    if (taken.ok()) {
      options.cuda_device = deps_.cuda_device;
      return taken;
    }
    spdlog::warn("SAM computes borders of masks on the CPU: {}", taken.status().ToString());
    bytes.device = 0;
  }
  return deps_.models.TakeServerMemory(bytes);
}

// Loading takes a second: it is left to the first request. Clients do not learn the server's paths.
absl::Status ViewImages::OpenSam() {
  if (sam_ != nullptr) return absl::OkStatus();
  SamOptions sam_options = {.num_threads = deps_.num_threads};
  ASSIGN_OR_RETURN(std::unique_ptr<ReservedMemory> memory, TakeMemory(sam_options));
  auto sam = SamBorders::Open(deps_.sam, sam_options);
  if (sam.ok()) {
    sam_ = *std::move(sam);
    memory_ = std::move(memory);
    spdlog::info("SAM is in memory, for borders of masks, on {}", sam_->processor());
    reported_failure_ = sam_->cuda_failed();
    return absl::OkStatus();
  }
  spdlog::error("sam_borders: {}", sam.status().ToString());
  if (absl::IsResourceExhausted(sam.status())) {
    return absl::ResourceExhaustedError("SAM does not fit into the server's memory");
  }
  return absl::FailedPreconditionError("SAM cannot be loaded: the server's log says why");
}

// Warns once when the GPU has failed.
void ViewImages::ReportProcessor() {
  if (reported_failure_ || !sam_->cuda_failed()) return;
  reported_failure_ = true;
  spdlog::warn("SAM computes borders of masks on {}", sam_->processor());
}

absl::StatusOr<Image> ViewImages::Photograph(const ResidentModel& model, const ModelView& view,
                                             absl::FunctionRef<bool()> wanted) const {
  RETURN_IF_ERROR(CheckPhotograph(model, view));
  StoredPhotographs photographs(deps_.store, deps_.blobs, deps_.photographs, model.id, wanted);
  return photographs.Formed(view, {.view = view, .max_side = kSamFrame});
}

absl::StatusOr<std::filesystem::path> ViewImages::KeptFile(const ResidentModel& model,
                                                           const ModelView& view) const {
  RETURN_IF_ERROR(CheckPhotograph(model, view));
  ASSIGN_OR_RETURN(const ModelRecord record,
                   deps_.store.models().GetModel(model.id.scene, model.id.number));
  const std::filesystem::path file =
      deps_.models.data_folder() / record.folder / EmbeddingFileName(view.name);
  // Spares the database a list of files.
  std::error_code ignored;
  if (std::filesystem::exists(file, ignored)) return file;
  return absl::NotFoundError("the training has kept no embedding");
}

bool ViewImages::HasKept(const ResidentModel& model, const ModelView& view) const {
  return KeptFile(model, view).ok();
}

// The dataset of a model does not change. Where it has no such photograph, which then was a frame
// of a video, or is deleted, the model's folder alone says whose the embedding is.
absl::StatusOr<SamEmbedding> ViewImages::ReadKept(const ResidentModel& model, const ModelView& view,
                                                  absl::FunctionRef<bool()> wanted) const {
  ASSIGN_OR_RETURN(const std::filesystem::path kept, KeptFile(model, view));
  EmbeddingOrigin origin = {sam_->encoder_digest(), ""};
  StoredPhotographs photographs(deps_.store, deps_.blobs, deps_.photographs, model.id, wanted);
  const absl::StatusOr<DatasetFileRecord> file = photographs.Find(view);
  if (file.ok()) origin.photograph = file->sha256;
  auto embedding = ReadKeptEmbedding(kept.parent_path(), view, origin);
  if (!embedding.ok() && !absl::IsNotFound(embedding.status())) {
    spdlog::warn("SAM: a kept embedding is not used: {}", embedding.status().ToString());
  }
  return embedding;
}

absl::StatusOr<ViewImages::ViewEmbedding> ViewImages::Compute(
    const ResidentModel& model, const ModelView& view, absl::FunctionRef<bool()> wanted) const {
  ViewEmbedding found;
  absl::StatusOr<Image> image = Photograph(model, view, wanted);
  if (absl::IsCancelled(image.status())) return image.status();
  found.image = BorderImage::kPhotograph;
  if (!image.ok()) {
    // Any other error leaves the rendering, and the answer says so.
    spdlog::debug("SAM: view {}: {}", view.name, image.status().ToString());
    ASSIGN_OR_RETURN(image, model->segmenter().RenderColor(view));
    found.image = BorderImage::kRendering;
  }
  ASSIGN_OR_RETURN(found.embedding, sam_->Embed(*image));
  // The photograph may be shrunk; masks have the size of the view.
  found.embedding.width = view.camera.width;
  found.embedding.height = view.camera.height;
  return found;
}

absl::StatusOr<const ViewImages::ViewEmbedding*> ViewImages::FindEmbedding(
    const ResidentModel& model, const ModelView& view, absl::FunctionRef<bool()> wanted) {
  std::string key;
  // Not model.name: scenes of two projects may have one name.
  if (!view.name.empty()) {
    key = absl::StrCat(model.id.scene.id, "/", model.id.number, "/", view.name);
  }
  for (auto at = recent_.begin(); at != recent_.end(); ++at) {
    if (key.empty() || at->key != key) continue;
    recent_.splice(recent_.begin(), recent_, at);
    return &recent_.front();
  }
  ViewEmbedding found;
  auto kept = ReadKept(model, view, wanted);
  if (kept.ok()) {
    found.embedding = *std::move(kept);
    found.image = BorderImage::kPhotograph;
    found.kept = true;
  } else {
    ASSIGN_OR_RETURN(found, Compute(model, view, wanted));
  }
  found.key = std::move(key);
  recent_.push_front(std::move(found));
  if (recent_.size() > kMostRecent) recent_.pop_back();
  return &recent_.front();
}

absl::StatusOr<const ViewImages::ViewEmbedding*> ViewImages::Prepare(const ResidentModel& model,
                                                                     const ModelView& view,
                                                                     const WantedCheck& check) {
  RETURN_IF_ERROR(check());
  RETURN_IF_ERROR(CheckAvailable());
  RETURN_IF_ERROR(OpenSam());
  return FindEmbedding(model, view, [&] { return check().ok(); });
}

// The images of one model.
class ViewImages::ModelImages final : public ImageSegmenter {
 public:
  ModelImages(ViewImages& images, const ResidentModel& model) : images_(images), model_(model) {}

  absl::StatusOr<ImageMasks> Click(const ModelView& view, std::span<const PointPrompt> clicks,
                                   const SoftMask* before, const WantedCheck& check) override {
    return MasksIn(view, check,
                   [&](const PhotographSam& sam) { return sam.Click(clicks, before); });
  }

  absl::StatusOr<ImageMasks> Box(const ModelView& view, const BoxPrompt& box,
                                 const WantedCheck& check) override {
    return MasksIn(view, check, [&](const PhotographSam& sam) { return sam.Box(box); });
  }

  absl::Status Refine(const ModelView& view, Change change, const WantedCheck& check,
                      SegmentResult& result) override {
    const std::lock_guard lock(images_.mutex_);
    ASSIGN_OR_RETURN(const ViewEmbedding* found, images_.Prepare(model_, view, check));
    const PhotographSam sam = {*images_.sam_, found->embedding, view, found->kept};
    ASSIGN_OR_RETURN(
        BinaryMask mask,
        sam.Refine(result.mask, change == Change::kWhole ? kRefineWhole : RefineLimits()));
    images_.ReportProcessor();
    SetMask(std::move(mask), result);
    result.border_image = found->image;
    return absl::OkStatus();
  }

 private:
  using Ask = absl::FunctionRef<absl::StatusOr<std::vector<SoftMask>>(const PhotographSam&)>;
  // Returns what SAM answers in the image of a view.
  absl::StatusOr<ImageMasks> MasksIn(const ModelView& view, const WantedCheck& check, Ask ask) {
    const std::lock_guard lock(images_.mutex_);
    ASSIGN_OR_RETURN(const ViewEmbedding* found, images_.Prepare(model_, view, check));
    ImageMasks result = {{}, found->image};
    ASSIGN_OR_RETURN(result.masks, ask({*images_.sam_, found->embedding, view, found->kept}));
    images_.ReportProcessor();
    return result;
  }

  ViewImages& images_;
  const ResidentModel& model_;
};

// SAM's encoder in the images of one model.
class ViewImages::ModelEncoder final : public ImageEncoder {
 public:
  ModelEncoder(ViewImages& images, const ResidentModel& model) : images_(images), model_(model) {}

  absl::StatusOr<ImageFeatures> Encode(const ModelView& view, int width, int height,
                                       const WantedCheck& check) override {
    const std::lock_guard lock(images_.mutex_);
    ASSIGN_OR_RETURN(const ViewEmbedding* found, images_.Prepare(model_, view, check));
    images_.ReportProcessor();
    const PhotographSam sam = {*images_.sam_, found->embedding, view, found->kept};
    ImageFeatures features;
    features.cells = sam.CellsOf(width, height);
    features.channels =
        static_cast<int>(found->embedding.values.size() / (size_t{kSamCells} * kSamCells));
    features.values = found->embedding.values;
    return features;
  }

 private:
  ViewImages& images_;
  const ResidentModel& model_;
};

std::unique_ptr<ImageEncoder> ViewImages::EncoderOf(const ResidentModel& model) {
  return std::make_unique<ModelEncoder>(*this, model);
}

std::unique_ptr<ImageSegmenter> ViewImages::SegmenterOf(const ResidentModel& model) {
  return std::make_unique<ModelImages>(*this, model);
}

}  // namespace pepeseg
