#pragma once

#include "absl/status/statusor.h"
#include "core/query/segmenter.h"
#include "pepeseg/v1/segmentation_service.pb.h"

namespace pepeseg {

// What a Segment request asks, in the model's terms.
struct SegmentQuestion {
  Segmenter::Prompt prompt;
  std::vector<ModelView> targets;
};

// INVALID_ARGUMENT names the field.
absl::StatusOr<SegmentQuestion> ReadQuestion(const v1::SegmentRequest& request, const Model& model);

// Likewise, of a ProposeScales request.
struct ProposalQuestion {
  Segmenter::Prompt prompt;
  int max_proposals;
};
absl::StatusOr<ProposalQuestion> ReadQuestion(const v1::ProposeScalesRequest& request,
                                              const Model& model);

// The view that a viewpoint names, or its free camera.
absl::StatusOr<ModelView> FindViewpoint(const v1::Viewpoint& viewpoint, const Model& model,
                                        const std::string& field);

// One view's part of the answer, encoded.
absl::StatusOr<v1::SegmentResponse::ViewMask> EncodeMask(const std::string& view,
                                                         const SegmentResult& result,
                                                         v1::MaskEncoding encoding);

}  // namespace pepeseg
