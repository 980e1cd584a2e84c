#pragma once

#include <filesystem>
#include <memory>

#include "grpcpp/support/server_interceptor.h"
#include "server/observe/rpc_metrics.h"

namespace pepeseg {

// Metadata of every call, its client's own where it is well-formed, else made here. The request id
// is sent back with the initial metadata.
inline constexpr char kRequestIdKey[] = "x-request-id";
inline constexpr char kTraceparentKey[] = "traceparent";

// Sees every call of a listener, its in-process channel's too: gives it a request id and a trace,
// counts it in `metrics` and writes a line when it has ended. So no handler has to. What of an
// error is for the log only goes into that line and not to the client: see HidePrivateText.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallInterceptors(
    RpcMetrics& metrics, std::filesystem::path data_folder);

}  // namespace pepeseg
