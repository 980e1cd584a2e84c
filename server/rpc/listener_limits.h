#pragma once

#include "absl/time/time.h"
#include "grpcpp/server_builder.h"

namespace pepeseg {

struct ListenerLimits {
  int max_message_bytes = 8 << 20;  // either way
  // Of a connection, so that clients come to know new servers behind a gateway. gRPC varies it by
  // 10 %, else those that came together would come back together. Streams then get as long again to
  // end by themselves.
  absl::Duration max_age = absl::Hours(1);
};

// What clients may take of a listener: memory, connections, streams, metadata, pings.
void SetLimits(grpc::ServerBuilder& builder, const ListenerLimits& limits);

}  // namespace pepeseg
