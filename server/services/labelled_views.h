#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/annotations/things.h"
#include "core/annotations/things_table.h"
#include "pepeseg/v1/label_service.pb.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

// The labels of a scene in the views of a model, segmented in parts, so that a thread can turn to
// other work in between.
class LabelledViews {
 public:
  // Loads the model and reads labels and views; blocks. `request` must outlive it.
  // FAILED_PRECONDITION (NO_LABELS): the scene has none. NOT_FOUND: a label. Other errors are those
  // of the model and of FindTargets.
  static absl::StatusOr<std::unique_ptr<LabelledViews>> Begin(
      const SegmentTools& tools, QueryCall call, const v1::ExportAnnotationsRequest& request);

  const ResidentModel& model() const { return model_; }
  const AnnotatedScene& scene() const { return scene_; }
  int64_t num_masks() const {
    return static_cast<int64_t>(scene_.views.size() * scene_.things.size());
  }
  int64_t num_masks_done() const { return num_done_; }
  // Returns the pixels of the largest view, of the photograph and of the model.
  int64_t max_pixels() const { return max_pixels_; }

  // Segments one view of one label, or begins to. Returns true if the masks of a label in some
  // views have become complete.
  absl::StatusOr<bool> SegmentSome();
  // Returns the views whose masks are complete, in order, each once.
  std::vector<AnnotatedView> TakeComplete();
  bool done() const { return num_done_ == num_masks(); }

  // Selects the Gaussians of a thing. Errors are those of CreateSelection for its label.
  absl::StatusOr<ThingGaussians> GaussiansOf(size_t thing) const;

 private:
  LabelledViews(const SegmentTools& tools, QueryCall call,
                const v1::ExportAnnotationsRequest& request)
      : tools_(tools), call_(std::move(call)), request_(request) {}
  absl::Status ReadLabels();
  absl::Status ReadViews();
  absl::Status BeginAnswer();
  // Takes the masks of the answer.
  absl::Status TakeAnswer();

  const SegmentTools tools_;
  const QueryCall call_;
  const v1::ExportAnnotationsRequest& request_;
  ResidentModel model_;
  AnnotatedScene scene_;
  std::vector<LabelRecord> labels_;  // of the things
  int64_t max_pixels_ = 0;
  int64_t num_done_ = 0;
  size_t first_view_ = 0;  // of those that are being segmented
  size_t thing_ = 0;       // that is being segmented in them
  std::vector<AnnotatedView> open_;
  std::vector<AnnotatedView> complete_;
  // The answer that is being computed refers to the other two.
  v1::SegmentViewsRequest asked_;
  v1::SegmentViewsResponse answered_;
  std::unique_ptr<SegmentAnswer> answer_;  // null: none is being computed
};

}  // namespace pepeseg
