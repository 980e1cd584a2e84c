#pragma once

#include <functional>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/unary.h"

namespace pepeseg {

// A question on its pool thread, from whatever kind of call.
struct QueryCall {
  absl::Duration queued;           // how long it waited for the thread
  std::function<bool()> given_up;  // nobody waits for the answer any more
};

// CANCELLED when it was given up between two views.
absl::Status AnswerSegment(const QueryCall& call, const ServiceContext& context,
                           const v1::SegmentRequest& request, v1::SegmentResponse* response);
absl::Status AnswerProposeScales(const UnaryCall& call, const ServiceContext& context,
                                 const v1::ProposeScalesRequest& request,
                                 v1::ProposeScalesResponse* response);

}  // namespace pepeseg
