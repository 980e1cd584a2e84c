#include "server/rpc/listener_limits.h"

#include <grpcpp/resource_quota.h>

namespace pepeseg {
namespace {

constexpr int kMaxMetadataBytes = 16 << 10;
constexpr int kMaxStreamsPerConnection = 256;
// Of requests on their way in, all connections together: gRPC slows them down, and at last ends
// some, before it takes more.
constexpr size_t kMaxIncomingBytes = size_t{512} << 20;
// gRPC's own, where it starts threads for calls: none does here.
constexpr int kMaxCallThreads = 32;
constexpr int kKeepaliveMs = 30'000;
constexpr int kKeepaliveTimeoutMs = 10'000;
constexpr int kMinPingIntervalMs = 10'000;
constexpr int kMaxPingStrikes = 2;
constexpr int kMaxIdleMs = 900'000;
// TLS handshake and the client's HTTP/2 settings: connections that say nothing hold a descriptor no
// longer than this.
constexpr int kHandshakeMs = 10'000;

}  // namespace

void SetLimits(grpc::ServerBuilder& builder, const ListenerLimits& limits) {
  const auto max_age_ms = static_cast<int>(absl::ToInt64Milliseconds(limits.max_age));
  builder.SetMaxReceiveMessageSize(limits.max_message_bytes);
  builder.SetMaxSendMessageSize(limits.max_message_bytes);
  grpc::ResourceQuota quota("pepeseg");
  quota.Resize(kMaxIncomingBytes).SetMaxThreads(kMaxCallThreads);
  builder.SetResourceQuota(quota);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, kMaxStreamsPerConnection);
  // Finds watchers whose machine is gone, also silent ones, and lets theirs find us.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // Of clients that ping more often than that, the connection goes.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                             kMinPingIntervalMs);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, kMaxPingStrikes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, max_age_ms);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_GRACE_MS, max_age_ms);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, kMaxIdleMs);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeMs);
}

}  // namespace pepeseg
