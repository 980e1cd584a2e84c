#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/server_status.pb.h"
#include "server/services/operations.h"

namespace pepeseg {

// What a server does just now. Blocks on the store.
absl::Status AnswerStatus(const Operations& operations, v1::ServerStatus* response);

// Begins or takes back draining, then answers as AnswerStatus.
absl::Status AnswerDrain(Operations& operations, const v1::DrainRequest& request,
                         v1::ServerStatus* response);

}  // namespace pepeseg
