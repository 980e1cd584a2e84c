#pragma once

#include <grpcpp/support/status.h>

#include <optional>

#include "absl/status/status.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg::client {

// The same code and message, and the server's ErrorDetail as a payload; of what a proxy has
// answered by HTTP, what it means.
absl::Status FromGrpc(const grpc::Status& status);

// What the server said besides: reason, field, resource, limit, how long to wait.
std::optional<v1::ErrorDetail> DetailOf(const absl::Status& status);

}  // namespace pepeseg::client
