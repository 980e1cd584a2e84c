#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "pepeseg/v1/segmentation_service.pb.h"
#include "server/rpc/call_runner.h"
#include "server/rpc/stream.h"
#include "server/rpc/stream_registry.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// Measures the parts of a call, one after the other.
class Stopwatch {
 public:
  // Returns the time since the last lap, or since construction.
  absl::Duration Lap();

 private:
  absl::Time start_ = absl::Now();
};

// Maximum size of an answer in bytes: what gRPC clients take in one message by default.
inline constexpr size_t kAnswerBytes = size_t{4} << 20;

// Returns RESOURCE_EXHAUSTED for more than kAnswerBytes.
absl::Status CheckAnswerSize(size_t num_bytes);

// A query on its pool thread, from a unary call or a stream.
struct QueryCall {
  absl::Duration queued;           // how long it waited for the thread
  std::function<bool()> given_up;  // returns whether the client no longer waits for the answer
};

// Answers the calls of SegmentationService that segment views. Both block for as long as the model
// takes to load. The models must outlive it.
class SegmentAnswers {
 public:
  explicit SegmentAnswers(ModelLoader& models) : models_(models) {}

  // Segments one view after the other, and looks before each whether the client still waits.
  // CANCELLED: it does not.
  absl::Status Segment(const QueryCall& call, const v1::SegmentViewsRequest& request,
                       v1::SegmentViewsResponse* response) const;
  absl::Status ProposeScales(const UnaryCall& call, const v1::ProposeScalesRequest& request,
                             v1::ProposeScalesResponse* response) const;

 private:
  ModelLoader& models_;
};

// A StreamSegments call: one answer at a time, to the newest request. A newer request ends the work
// on the answer between two views; an error is sent as an answer and the stream continues. Key and
// scope are checked when the call begins, and each request is authorised for itself; one that is
// refused ends the stream. The stream also ends if the first request does not come within
// StreamLimits::first_message.
class StreamSegmentsCall final
    : public NewestStream<v1::StreamSegmentsRequest, v1::StreamSegmentsResponse> {
 public:
  StreamSegmentsCall(const CallRunner& runner, ModelLoader& models, CallOrigin origin)
      : NewestStream(&runner.streams(), &runner.pools().query),
        runner_(runner),
        models_(models),
        origin_(std::move(origin)) {}

 private:
  Step Work(bool io_ok) override;
  // Authorises a request, or the call itself while there is no request.
  absl::Status Authorize(v1::StreamSegmentsRequest& request);
  // Fills `message_` with the answer or the error. Returns false if the request was given up.
  bool Answer(const v1::StreamSegmentsRequest& request);

  const CallRunner& runner_;
  ModelLoader& models_;
  const CallOrigin origin_;
  const absl::Time begin_ = absl::Now();
  bool admitted_ = false;  // the caller may use this stream
  bool asked_ = false;     // a request has come
  std::string project_;    // the caller's
};

}  // namespace pepeseg
