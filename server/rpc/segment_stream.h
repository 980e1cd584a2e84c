#pragma once

#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/stream.h"

namespace pepeseg {

// A SegmentStream call: one answer at a time, to the newest request. One that comes meanwhile ends
// the work on the answer between two views; an error is told and the stream goes on.
class SegmentStreamCall final
    : public NewestStream<v1::SegmentStreamRequest, v1::SegmentStreamResponse> {
 public:
  explicit SegmentStreamCall(const ServiceContext& context)
      : NewestStream(context.streams, context.query_pool), context_(context) {}

 private:
  Step Work(bool io_ok) override;

  const ServiceContext context_;
};

}  // namespace pepeseg
