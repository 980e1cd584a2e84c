#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/decomposition.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/unary.h"

namespace pepeseg {

// Answers a Decompose call. Blocks for as long as the model takes to load and to be taken apart.
absl::Status AnswerDecompose(const UnaryCall& call, const ServiceContext& context,
                             const v1::DecomposeRequest& request, v1::DecomposeResponse* response);

}  // namespace pepeseg
