#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/services/job_snapshots.h"
#include "server/services/model_loader.h"
#include "server/services/view_images.h"

namespace pepeseg {

// What answers to SegmentViewsRequests are made with. All must outlive the answers.
struct SegmentTools {
  JobSnapshots& models;
  Store& store;
  ViewImages& images;
};

// Returns whether a request asks for SAM's help by name.
bool AsksSam(const v1::SegmentViewsRequest& request);

// A query on its pool thread, from a unary call or a stream.
struct QueryCall {
  absl::Duration queued;  // how long it waited for the thread
  NamedScenes scenes;     // that the request names
  WantedCheck check;      // whether the client still waits for the answer
};

// The answer to a SegmentViewsRequest, computed one view at a time, so that a thread can turn to
// others after each view. Holds the model in memory.
class SegmentAnswer {
 public:
  // Loads the model, which blocks, and reads the request. SAM helps as the request and the model
  // say. Fills `response`; it and `request` must outlive the answer.
  static absl::StatusOr<std::unique_ptr<SegmentAnswer>> Begin(
      const SegmentTools& tools, QueryCall call, const v1::SegmentViewsRequest& request,
      v1::SegmentViewsResponse* response);

  // Returns whether SAM helps, which takes longer than other queries.
  bool asks_sam() const { return images_ != nullptr; }
  // Segments the next view. Returns nullopt if there are more, else how the answer ends.
  std::optional<absl::Status> SegmentNext();

 private:
  SegmentAnswer(const v1::SegmentViewsRequest& request, v1::SegmentViewsResponse* response)
      : request_(request), response_(response) {}
  absl::Status ChooseSam(const SegmentTools& tools);
  // Returns FAILED_PRECONDITION if a request asks for SAM of a model in training.
  absl::Status CheckAsksNoSam() const;
  bool LeaveSam(const absl::Status& status);
  absl::Status BeginViews();

  const v1::SegmentViewsRequest& request_;
  v1::SegmentViewsResponse* const response_;
  ResidentModel model_;
  std::unique_ptr<ImageSegmenter> images_;  // refers to the model; null: SAM is not asked
  bool is_sam_needed_ = false;              // the request asks for it by name
  SegmentRequest asked_;
  WantedCheck check_;
  std::optional<SegmentedViews> views_;  // refers to the model and the images; absent: not begun
  size_t num_bytes_ = 0;                 // of the masks so far
  absl::Duration compute_;
  absl::Duration encode_;
};

}  // namespace pepeseg
