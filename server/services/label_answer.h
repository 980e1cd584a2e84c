#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/label.pb.h"
#include "server/rpc/service_context.h"

// Answers to calls about labels, with the errors of the contract. All of them block.
namespace pepeseg {

// Loads the live model where it is not in memory: for the pool of what computes.
absl::Status AnswerCreateLabel(const ServiceContext& context, const v1::CreateLabelRequest& request,
                               v1::Label* response);
absl::Status AnswerListLabels(const ServiceContext& context, const v1::ListLabelsRequest& request,
                              v1::ListLabelsResponse* response);
absl::Status AnswerDeleteLabel(const ServiceContext& context,
                               const v1::DeleteLabelRequest& request);

}  // namespace pepeseg
