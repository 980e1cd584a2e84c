#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/query/prompt.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/services/model_lookup.h"

// What a request asks, in the model's terms. INVALID_ARGUMENT names the field.
namespace pepeseg {

struct SegmentQuestion {
  Prompt prompt;
  Granularity granularity;
  std::vector<ModelView> targets;
};
absl::StatusOr<SegmentQuestion> ReadQuestion(const ServiceContext& context,
                                             const ResidentModel& model,
                                             const v1::SegmentRequest& request);

struct ProposalQuestion {
  ModelView view;
  std::vector<PointPrompt> points;
  int max_proposals;
};
absl::StatusOr<ProposalQuestion> ReadQuestion(const ServiceContext& context,
                                              const ResidentModel& model,
                                              const v1::ProposeScalesRequest& request);

}  // namespace pepeseg
