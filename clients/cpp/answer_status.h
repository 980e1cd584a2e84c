#pragma once

#include <grpcpp/support/status.h>

#include <optional>

#include "absl/status/status.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg::client {

// Returns the status of a call with the same code and message, and the server's ErrorDetail as a
// payload.
//
// A status without an ErrorDetail was not made by the server but by something in front of it. Our
// gateway answers with a gRPC status, which is returned as it is. Other proxies answer with HTTP,
// which gRPC reports as UNKNOWN or UNAVAILABLE in words of its own: the result then has the code
// that the HTTP status stands for, and a message that says so.
absl::Status FromGrpc(const grpc::Status& status);

// Returns the ErrorDetail of a status of FromGrpc: reason, field, resource, limit, time to wait.
// Empty if the server sent none.
std::optional<v1::ErrorDetail> DetailOf(const absl::Status& status);

}  // namespace pepeseg::client
