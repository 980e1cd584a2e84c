#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "grpcpp/server_context.h"
#include "grpcpp/support/server_interceptor.h"
#include "grpcpp/support/status.h"
#include "server/observe/metrics.h"

namespace pepeseg {

// Metadata that each call has: the client's own if it is well-formed, else the interceptor makes
// it. The request id is sent back with the initial metadata.
inline constexpr char kRequestIdKey[] = "x-request-id";
inline constexpr char kTraceparentKey[] = "traceparent";

// Decides whether the caller may use gRPC's reflection. That service checks no keys itself.
// Called on the thread that will answer the call; may block.
using ReflectionCheck = std::function<grpc::Status(const grpc::ServerContextBase&)>;

// Makes interceptors that see each call of a listener, also those of its in-process channel: they
// give the call a request id and a trace, count it in `metrics` and log a line when it ends. Text
// of an error that is for the log only goes into this line and is removed from the answer
// (HidePrivateText). A call of reflection that `reflection` refuses ends with its status, and
// gRPC's service sees empty requests only, which it answers with nothing.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallInterceptors(
    RpcMetrics& metrics, std::filesystem::path data_folder, ReflectionCheck reflection = nullptr);

}  // namespace pepeseg
