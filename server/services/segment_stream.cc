#include "server/services/segment_stream.h"

#include <spdlog/spdlog.h>

#include <optional>

#include "absl/time/clock.h"
#include "server/api/client_error.h"
#include "server/api/error.h"
#include "server/services/segment_answer.h"

namespace pepeseg {

Stream::Step SegmentStreamCall::Work(bool) {
  std::optional<v1::SegmentStreamRequest> request = TakeNewest();
  if (request || !admitted_) {
    v1::SegmentStreamRequest none;
    const auto caller =
        context_.authorizer->AuthorizeAndResolve(origin_, request ? *request : none);
    if (!caller.ok()) return {Next::kEnd, caller.status()};
    project_ = caller->project;
    if (!admitted_) {
      absl::Status status = Admit(OwnerOf(*caller, origin_));
      if (!status.ok()) return {Next::kEnd, std::move(status)};
    }
    admitted_ = true;
  }
  asked_ = asked_ || request.has_value();
  const absl::Duration first_message = context_.streams->limits().first_message;
  if (!asked_ && absl::Now() - begin_ > first_message) {
    return {Next::kEnd, TooSlowError(first_message)};
  }
  if (!request) return {all_read() ? Next::kEnd : Next::kIdle, absl::OkStatus()};
  const QueryCall call = {absl::ZeroDuration(), [this] { return cancelled() || superseded(); }};
  message_.Clear();
  message_.set_sequence(request->sequence());
  const absl::Time start = absl::Now();
  absl::Status status = context_.quotas->Admit(project_, *request);
  if (status.ok()) {
    status = AnswerSegment(call, context_, request->segment(), message_.mutable_segment());
  }
  if (absl::IsCancelled(status)) {
    Wake();  // for the newer one
    return {Next::kIdle, absl::OkStatus()};
  }
  const absl::Time end = absl::Now();
  context_.query_pool->latencies().Record(end - start, end);
  if (!status.ok()) {
    *message_.mutable_error() = ToProto(status);
    const ClientErrorRules rules = {context_.data_folder, origin_.request_id};
    if (HidePrivateText(rules, *message_.mutable_error())) {
      spdlog::warn("SegmentStream: {}, request {}", status.ToString(), origin_.request_id);
    }
  }
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
