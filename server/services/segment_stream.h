#pragma once

#include <string>
#include <utility>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// A SegmentStream call: one answer at a time, to the newest request. One that comes meanwhile ends
// the work on the answer between two views; an error is told and the stream goes on. Every request
// is authorised for itself; one that is refused ends the stream. Key and scope are checked when the
// call begins, and a stream whose first request does not come in time ends.
class SegmentStreamCall final
    : public NewestStream<v1::SegmentStreamRequest, v1::SegmentStreamResponse> {
 public:
  SegmentStreamCall(const ServiceContext& context, CallOrigin origin)
      : NewestStream(context.streams, context.query_pool),
        context_(context),
        origin_(std::move(origin)) {}

 private:
  Step Work(bool io_ok) override;

  const ServiceContext context_;
  const CallOrigin origin_;
  const absl::Time begin_ = absl::Now();
  bool admitted_ = false;  // the caller may ask at all
  bool asked_ = false;     // a request has come
  std::string project_;    // the caller's
};

}  // namespace pepeseg
