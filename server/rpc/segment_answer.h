#pragma once

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg {

// What a Segment request asks, in the model's terms.
struct SegmentQuestion {
  Prompt prompt;
  Granularity granularity;
  std::vector<ModelView> targets;
};

// INVALID_ARGUMENT names the field.
absl::StatusOr<SegmentQuestion> ReadQuestion(const v1::SegmentRequest& request, const Model& model);

// Likewise, of a ProposeScales request.
struct ProposalQuestion {
  ModelView view;
  std::vector<PointPrompt> points;
  int max_proposals;
};
absl::StatusOr<ProposalQuestion> ReadQuestion(const v1::ProposeScalesRequest& request,
                                              const Model& model);

// One view's part of the answer, encoded.
absl::StatusOr<v1::SegmentResponse::ViewMask> EncodeMask(const std::string& view,
                                                         const SegmentResult& result,
                                                         v1::MaskEncoding encoding);

}  // namespace pepeseg
