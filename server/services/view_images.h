#pragma once

#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/find/image_encoder.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/scene_model.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Segments the photographs of views by SAM (core/priors/sam/sam_borders.h): answers clicks in them,
// and refines masks. Loads SAM with the first request and keeps it, on the GPU where there is one
// with room for it: 350 MB of host memory, and on a GPU 700 MiB of its memory. Where the GPU fails
// or is out of memory, the CPU takes over for good, and the log says so once. Takes what SAM needs
// of a photograph from the model's folder, if the training has kept it there, or else computes it;
// keeps that of the most recent views. All is counted in the budget of the models. Thread safe; one
// mask is computed at a time.
class ViewImages {
 public:
  // All must outlive it.
  struct Dependencies {
    std::filesystem::path sam;  // folder of SAM's files; empty: the server has none
    int num_threads = 1;        // of SAM
    std::optional<int> cuda_device = std::nullopt;  // of SAM; absent: the CPU
    Store& store;
    ModelLoader& models;
    const BlobStore& blobs;
    const PhotographProcess& photographs;
  };
  explicit ViewImages(const Dependencies& deps) : deps_(deps) {}

  // Returns FAILED_PRECONDITION if the server has no SAM. remedy: what the client can do instead.
  absl::Status CheckAvailable(
      absl::string_view remedy = "leave sam_borders and sam_clicks out") const;

  // Returns whether the training has kept what SAM needs of a view's photograph.
  bool HasKept(const ResidentModel& model, const ModelView& view) const;
  // Returns what segments the images of the model's views; the model must outlive it as this must.
  // Its errors: those of `check`. FAILED_PRECONDITION: SAM's files are damaged. RESOURCE_EXHAUSTED:
  // out of memory, or SAM exceeds the budget of the models. UNAVAILABLE: models in use leave it no
  // room for now.
  std::unique_ptr<ImageSegmenter> SegmenterOf(const ResidentModel& model);
  // Returns SAM's encoder for these images, with the same errors.
  std::unique_ptr<ImageEncoder> EncoderOf(const ResidentModel& model);

 private:
  // SAM's embedding of a view's image.
  struct ViewEmbedding {
    std::string key;  // of model and view; empty: a free camera
    SamEmbedding embedding;
    bool kept = false;  // by the training: it is of the photograph, and not of the view
    BorderImage image = BorderImage::kNone;
  };
  class ModelImages;
  class ModelEncoder;

  // Returns the embedding of a view, with SAM ready to use it. With mutex_ held.
  absl::StatusOr<const ViewEmbedding*> Prepare(const ResidentModel& model, const ModelView& view,
                                               const WantedCheck& check);

  absl::Status OpenSam();
  absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeMemory(SamOptions& options);
  void ReportProcessor();
  // Returns what SAM needs of the view, from the cache or computed.
  absl::StatusOr<const ViewEmbedding*> FindEmbedding(const ResidentModel& model,
                                                     const ModelView& view,
                                                     absl::FunctionRef<bool()> wanted);
  // Returns the file with what the training has kept of the view's photograph.
  absl::StatusOr<std::filesystem::path> KeptFile(const ResidentModel& model,
                                                 const ModelView& view) const;
  // Reads what the training has kept. Damaged or missing files are errors, which the log has.
  absl::StatusOr<SamEmbedding> ReadKept(const ResidentModel& model, const ModelView& view,
                                        absl::FunctionRef<bool()> wanted) const;
  absl::StatusOr<ViewEmbedding> Compute(const ResidentModel& model, const ModelView& view,
                                        absl::FunctionRef<bool()> wanted) const;
  absl::StatusOr<Image> Photograph(const ResidentModel& model, const ModelView& view,
                                   absl::FunctionRef<bool()> wanted) const;

  const Dependencies deps_;
  std::mutex mutex_;
  std::unique_ptr<ReservedMemory> memory_;  // of all below; guarded by mutex_, as the following
  std::unique_ptr<SamBorders> sam_;
  bool reported_failure_ = false;    // of the GPU
  std::list<ViewEmbedding> recent_;  // the most recent first
};

}  // namespace pepeseg
