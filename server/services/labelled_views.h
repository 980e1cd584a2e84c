#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/label_service.pb.h"
#include "server/services/annotated_views.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

// Returns all labels of a scene, by id. Blocks.
absl::StatusOr<std::vector<LabelRecord>> AllLabels(const SceneRef& scene, Store& store);

// The labels of a scene as things. Each part is one view of one label.
class LabelledViews final : public AnnotatedViews {
 public:
  // Loads the model and reads labels and views; blocks. `request` must outlive it.
  // FAILED_PRECONDITION (NO_LABELS): the scene has none. NOT_FOUND: a label. Other errors are those
  // of the model and of FindTargets.
  static absl::StatusOr<std::unique_ptr<AnnotatedViews>> Begin(
      const SegmentTools& tools, QueryCall call, const v1::ExportAnnotationsRequest& request);

  absl::StatusOr<bool> FindSome() override;
  bool done() const override { return num_masks_done() == num_masks(); }
  // Selects the Gaussians. Errors are those of CreateSelection for the label.
  absl::StatusOr<ThingGaussians> GaussiansOf(size_t thing) const override;

 private:
  LabelledViews(const SegmentTools& tools, QueryCall call,
                const v1::ExportAnnotationsRequest& request)
      : tools_(tools), call_(std::move(call)), request_(request) {}
  absl::Status ReadLabels();
  absl::Status BeginAnswer();
  // Takes the masks of the answer.
  absl::Status TakeAnswer();

  const SegmentTools tools_;
  const QueryCall call_;
  const v1::ExportAnnotationsRequest& request_;
  std::vector<LabelRecord> labels_;  // of the things
  size_t first_view_ = 0;            // of those that are being segmented
  size_t thing_ = 0;                 // that is being segmented in them
  std::vector<AnnotatedView> open_;
  // The answer that is being computed refers to the other two.
  v1::SegmentViewsRequest asked_;
  v1::SegmentViewsResponse answered_;
  std::unique_ptr<SegmentAnswer> answer_;  // null: none is being computed
};

}  // namespace pepeseg
