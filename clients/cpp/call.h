#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/support/status.h>

#include <chrono>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/resource_names.h"

// Calls of the services' stubs: their context, deadline and retries.
namespace pepeseg::client {

// Default deadline of a call, seconds. It is long because the first query of a model loads it.
constexpr double kCallSeconds = 120;

// The context of one call.
class Call {
 public:
  // `scene`, an id or a name, is sent as routing key "x-scene"; "": no key. The call ends with
  // DEADLINE_EXCEEDED after `seconds`; 0: it has no deadline, for streams that last as long as a
  // job.
  Call(const std::string& scene, double seconds);
  operator grpc::ClientContext*() { return &context_; }  // NOLINT(google-explicit-constructor)
  void Cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
};

// Decides whether a failed call is repeated, and for how long in all.
//
// Repeated are calls that the server has put off: it answered UNAVAILABLE with
// ErrorDetail::retry_after and has done nothing yet, because too many calls are waiting, no memory
// for a model is free, or its database is away. A server that is shutting down (DRAINING) is not
// waited for.
class RetryBudget {
 public:
  // `seconds` covers all attempts together. 0: the calls have no deadline, and retries end after
  // two minutes.
  explicit RetryBudget(double seconds);

  // Returns the deadline of the next attempt, seconds, at least 0.001; 0 if calls have none.
  double seconds_left() const;
  // Sleeps for the time that the server asks for and returns true if the call may be repeated.
  // Returns false at once if `status` does not allow that or the budget would be exceeded.
  bool WaitAfter(const absl::Status& status) const;

 private:
  using Clock = std::chrono::steady_clock;
  const bool has_deadline_;
  const Clock::time_point end_;
};

// Calls a unary method of a stub, such as &v1::JobService::Stub::GetJob, and returns its response.
// Repeats calls that the server puts off, for at most `seconds` in all. `scene`: see Call.
template <typename Stub, typename Request, typename Response>
absl::StatusOr<Response> Ask(
    Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
    const std::string& scene, const Request& request, double seconds = kCallSeconds) {
  const RetryBudget retries(seconds);
  while (true) {
    Response response;
    Call call(scene, retries.seconds_left());
    const absl::Status status = FromGrpc((stub.*method)(call, request, &response));
    if (status.ok()) return response;
    if (!retries.WaitAfter(status)) return status;
  }
}

// Calls a List method page by page and returns all pages as one response without a page token.
template <typename Stub, typename Request, typename Response>
absl::StatusOr<Response> AskAllPages(Stub& stub,
                                     grpc::Status (Stub::*method)(grpc::ClientContext*,
                                                                  const Request&, Response*),
                                     const std::string& scene, Request request) {
  request.set_page_size(1000);
  Response all;
  do {
    absl::StatusOr<Response> page = Ask(stub, method, scene, request);
    if (!page.ok()) return page.status();
    request.set_page_token(page->next_page_token());
    page->clear_next_page_token();
    all.MergeFrom(*page);
  } while (!request.page_token().empty());
  return all;
}

}  // namespace pepeseg::client
