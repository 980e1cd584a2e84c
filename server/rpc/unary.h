#pragma once

#include <google/protobuf/message.h>

#include <utility>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"
#include "server/access/authorizer.h"
#include "server/rpc/error.h"
#include "server/rpc/service_context.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

// A unary call as it came.
struct UnaryRequest {
  grpc::CallbackServerContext* context;
  const google::protobuf::Message* message;
};

// A unary call on its pool thread, authorised.
struct UnaryCall {
  grpc::CallbackServerContext* context;
  absl::Duration queued;  // how long it waited for the thread
  const Caller& caller;

  // By the client or by its deadline: the answer is of no use any more.
  bool cancelled() const { return context->IsCancelled(); }
};

// Answers a unary call with what `handler`, an absl::Status(const UnaryCall&), says on a thread of
// the pool; it fills the response before it returns, and is not asked about a call that the
// context's authorizer or quotas refuse. UNAVAILABLE when the pool's queue is full.
template <typename Handler>
grpc::ServerUnaryReactor* RunOn(const UnaryRequest& request, const ServiceContext& services,
                                WorkerPool& pool, Handler handler) {
  grpc::CallbackServerContext* const context = request.context;
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Time start = absl::Now();
  const bool taken = pool.Submit([context, message = request.message,
                                  authorizer = services.authorizer, quotas = services.quotas,
                                  reactor, start, handler = std::move(handler)]() mutable {
    if (context->IsCancelled()) {
      reactor->Finish(ToGrpc(absl::CancelledError("the client is gone")));
      return;
    }
    const absl::Duration queued = absl::Now() - start;
    reactor->Finish(ToGrpc(authorizer->Run(OriginOf(*context), *message, [&](const Caller& caller) {
      absl::Status admitted = quotas->Admit(caller.project, *message);
      if (!admitted.ok()) return admitted;
      return handler(UnaryCall{context, queued, caller});
    })));
  });
  if (!taken) reactor->Finish(ToGrpc(BusyError()));
  return reactor;
}

// On the pool for what waits on the disk.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnPool(const UnaryRequest& request, const ServiceContext& services,
                                    Handler handler) {
  return RunOn(request, services, *services.pool, std::move(handler));
}

// On that for what computes.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnQueryPool(const UnaryRequest& request,
                                         const ServiceContext& services, Handler handler) {
  return RunOn(request, services, *services.query_pool, std::move(handler));
}

// On that for what does so at length.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnEvaluationPool(const UnaryRequest& request,
                                              const ServiceContext& services, Handler handler) {
  return RunOn(request, services, *services.evaluation_pool, std::move(handler));
}

}  // namespace pepeseg
