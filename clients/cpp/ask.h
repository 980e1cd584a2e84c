#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "absl/status/statusor.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/retry_budget.h"

namespace pepeseg::client {

// The answer to a unary method of a stub, as &v1::JobService::Stub::GetJob, about a scene's. A call
// that the server puts off is made again within `seconds`: see RetryBudget.
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

// A whole list, page after page, as one response without a token.
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
