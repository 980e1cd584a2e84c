#pragma once

#include "absl/status/statusor.h"
#include "server/data/blob_store.h"
#include "server/jobs/photograph_process.h"
#include "server/services/model_loader.h"
#include "server/services/stored_photographs.h"

namespace pepeseg {

// The images in which sources of words look for things. Thread safe.
class WordPhotographs {
 public:
  static constexpr int kMaxSide = 1024;  // pixels

  // All must outlive it.
  struct Dependencies {
    Store& store;
    const BlobStore& blobs;
    const PhotographProcess& photographs;
  };
  explicit WordPhotographs(const Dependencies& deps) : deps_(deps) {}

  // Returns what a view of the model shows, with a longer side of at most kMaxSide: its photograph,
  // formed like the view, or the model's rendering where there is none or the model is edited.
  // Blocks on the store and a decoder. Returns the error of `check`, or of RenderColor.
  absl::StatusOr<Image> Of(const ResidentModel& model, const ModelView& view,
                           const WantedCheck& check) const;

 private:
  const Dependencies deps_;
};

}  // namespace pepeseg
