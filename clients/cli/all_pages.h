#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "clients/cli/connection.h"
#include "clients/cli/failure.h"
#include "clients/cli/status_macros.h"

namespace pepeseg::cli {

// A whole list, page after page, as one response without a token. `ask`, a
// grpc::Status(Call&, const Request&, Response*), asks for one page of the scene's.
template <typename Response, typename Request, typename Ask>
absl::StatusOr<Response> AllPages(Request request, const std::string& scene, const Ask& ask) {
  request.set_page_size(1000);
  Response all;
  do {
    Response page;
    Call call(scene, kCallSeconds);
    RETURN_IF_ERROR(FromGrpc(ask(call, request, &page)));
    request.set_page_token(page.next_page_token());
    page.clear_next_page_token();
    all.MergeFrom(page);
  } while (!request.page_token().empty());
  return all;
}

}  // namespace pepeseg::cli
