#include "server/rpc/admin_listener.h"

#include <grpcpp/grpcpp.h>

#include "absl/strings/str_cat.h"
#include "server/rpc/call_interceptor.h"
#include "server/rpc/listener_limits.h"

namespace pepeseg {
namespace {

constexpr int kNumThreads = 2;  // a model's load takes one for long
constexpr size_t kMaxQueuedAdminCalls = 100;
// Requests are small; the list of what is in memory, or of what runs, may be long.
constexpr int kMaxAdminRequestBytes = 4 << 20;

ServiceContext OnPool(ServiceContext context, WorkerPool* pool) {
  context.pool = pool;
  return context;
}

}  // namespace

AdminListener::AdminListener(const ServiceContext& context, Operations& operations)
    : pool_(std::make_unique<WorkerPool>(kNumThreads, kMaxQueuedAdminCalls)),
      service_(OnPool(context, pool_.get()), operations) {}

absl::StatusOr<std::unique_ptr<AdminListener>> AdminListener::Start(const Listener& where,
                                                                    const ServiceContext& context,
                                                                    Operations& operations,
                                                                    RpcMetrics& metrics) {
  std::unique_ptr<AdminListener> listener(new AdminListener(context, operations));
  grpc::ServerBuilder builder;
  SetLimits(builder, {kMaxAdminRequestBytes, absl::Hours(1)});
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> interceptors;
  interceptors.push_back(MakeCallInterceptors(metrics));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));
  builder.AddListeningPort(where.address, where.credentials, &listener->port_);
  builder.RegisterService(&listener->service_);
  listener->server_ = builder.BuildAndStart();
  if (listener->server_ == nullptr) {
    return absl::UnavailableError(
        absl::StrCat("cannot listen on ", where.address, " for admin calls"));
  }
  return listener;
}

std::shared_ptr<grpc::Channel> AdminListener::InProcessChannel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

void AdminListener::Shutdown(absl::Time deadline) {
  server_->Shutdown(absl::ToChronoTime(deadline));
  server_->Wait();
  pool_->Stop();
}

}  // namespace pepeseg
