#pragma once

#include <string>

#include "absl/status/status.h"

// What stands between this program and the server may answer in the server's place: our gateway by
// a gRPC status without our ErrorDetail, others by HTTP, which gRPC tells in words of its own.
namespace pepeseg::client {

// The same in plain words, and with the code that it means here, where gRPC tells of an answer by
// HTTP; else `status` as it is.
absl::Status FromIntermediary(const absl::Status& status);

}  // namespace pepeseg::client
