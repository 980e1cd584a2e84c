#pragma once

#include <filesystem>
#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/priors/sam/sam_borders.h"
#include "core/query/view_features.h"
#include "core/scene/model.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Refines the borders of masks by SAM (core/priors/sam/sam_borders.h) in the photographs of views.
// Loads SAM with the first request and keeps it: 350 MB of host memory. Keeps what SAM needs of the
// most recent views. Both are counted in the budget of the models. Thread safe; one mask is refined
// at a time.
class BorderRefiner {
 public:
  // What it refers to must outlive it.
  struct Options {
    std::filesystem::path sam;  // folder of SAM's files; empty: the server has none
    int num_threads = 1;        // of SAM
    Store& store;
    ModelLoader& models;
    const BlobStore& blobs;
    const PhotographProcess& photographs;
  };
  explicit BorderRefiner(const Options& options) : options_(options) {}

  // Returns FAILED_PRECONDITION if the server has no SAM.
  absl::Status CheckAvailable() const;

  // Refines the mask of a view of the model, and returns the image that was used. `result` must
  // have the similarity, from which its score is computed again. CANCELLED: `wanted` returned
  // false. FAILED_PRECONDITION: SAM's files are damaged. RESOURCE_EXHAUSTED: out of memory, or SAM
  // exceeds the budget of the models. UNAVAILABLE: models in use leave it no room for now.
  absl::StatusOr<v1::SegmentViewsResponse::BorderImage> Refine(const ResidentModel& model,
                                                               const ModelView& view,
                                                               absl::FunctionRef<bool()> wanted,
                                                               SegmentResult& result);

 private:
  // What SAM needs of a view's image.
  struct Seen {
    std::string key;  // of model and view; empty: a free camera
    OnnxTensor embedding;
    v1::SegmentViewsResponse::BorderImage image =
        v1::SegmentViewsResponse::BORDER_IMAGE_UNSPECIFIED;
  };

  absl::Status OpenSam();
  // Returns what SAM needs of the view, from the cache or computed.
  absl::StatusOr<const Seen*> See(const ResidentModel& model, const ModelView& view,
                                  absl::FunctionRef<bool()> wanted);
  absl::StatusOr<Image> Photograph(const ResidentModel& model, const ModelView& view,
                                   absl::FunctionRef<bool()> wanted) const;

  const Options options_;
  std::mutex mutex_;
  std::unique_ptr<ReservedMemory> memory_;  // of all below; guarded by mutex_, as the following
  std::unique_ptr<SamBorders> sam_;
  std::list<Seen> recent_;  // the most recent first
};

}  // namespace pepeseg
