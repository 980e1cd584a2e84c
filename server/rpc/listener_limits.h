#pragma once

#include "grpcpp/server_builder.h"

namespace pepeseg {

// What clients may take of a listener: memory, connections, streams, metadata, pings. Messages of
// at most `max_message_bytes` either way.
void SetLimits(grpc::ServerBuilder& builder, int max_message_bytes);

}  // namespace pepeseg
