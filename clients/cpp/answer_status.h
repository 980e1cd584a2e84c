#pragma once

#include <grpcpp/support/status.h>

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg::client {

// Details of an error that the server sends with the code and the message. A field that was not
// sent is empty. proto/pepeseg/v1/errors.proto describes each.
struct ErrorDetail {
  std::string reason;    // for programs, such as "JOB_ACTIVE"
  std::string field;     // path of the request's field
  std::string resource;  // name of the resource that is missing or prevents the call
  std::string limit;     // the exceeded limit, with its unit
  std::string value;     // the value that exceeds it
  // Time after which the call may succeed if it is repeated; empty: waiting does not help.
  std::optional<absl::Duration> retry_after;
};

// Returns the status of a call with the same code and message, and the server's error details as
// payloads by their type URLs.
//
// A status without details was not made by the server but by something in front of it. Our
// gateway answers with a gRPC status, which is returned as it is. Other proxies answer with HTTP,
// which gRPC reports as UNKNOWN or UNAVAILABLE in words of its own: the result then has the code
// that the HTTP status stands for, and a message that says so.
absl::Status FromGrpc(const grpc::Status& status);

// Returns the details of a status of FromGrpc. Empty if the server sent none.
std::optional<ErrorDetail> DetailOf(const absl::Status& status);

}  // namespace pepeseg::client
