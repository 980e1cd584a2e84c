#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/annotations/things.h"
#include "core/annotations/things_table.h"
#include "pepeseg/v1/label_service.pb.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// The masks of things in views of a model, found in parts, so that a thread can turn to other work
// in between.
class AnnotatedViews {
 public:
  virtual ~AnnotatedViews() = default;

  const ResidentModel& model() const { return model_; }
  const AnnotatedScene& scene() const { return scene_; }
  int64_t num_masks() const {
    return static_cast<int64_t>(scene_.views.size() * scene_.things.size());
  }
  int64_t num_masks_done() const { return num_done_; }
  // Returns the pixels of the largest view, of the photograph or of the model.
  int64_t max_pixels() const { return max_pixels_; }

  // Finds the masks of a part. Returns true if there is progress to report. Must not be done.
  virtual absl::StatusOr<bool> FindSome() = 0;
  virtual bool done() const = 0;
  // Returns the views whose masks are complete, in order, each once.
  std::vector<AnnotatedView> TakeComplete() { return std::exchange(complete_, {}); }

  // Returns the Gaussians of a thing, which may take long.
  virtual absl::StatusOr<ThingGaussians> GaussiansOf(size_t thing) const = 0;

 protected:
  // Reads the views that the request means. Errors are those of FindTargets.
  absl::Status ReadViews(const v1::ExportAnnotationsRequest& request);

  ResidentModel model_;
  AnnotatedScene scene_;
  int64_t num_done_ = 0;  // masks
  std::vector<AnnotatedView> complete_;

 private:
  int64_t max_pixels_ = 0;
};

}  // namespace pepeseg
