#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/render.pb.h"
#include "server/rpc/service_context.h"
#include "server/rpc/unary.h"

namespace pepeseg {

// Answers a Render call. Blocks for as long as the model takes to load and, where a segment is
// named or asked for, to be taken apart.
absl::Status AnswerRender(const UnaryCall& call, const ServiceContext& context,
                          const v1::RenderRequest& request, v1::RenderResponse* response);

}  // namespace pepeseg
