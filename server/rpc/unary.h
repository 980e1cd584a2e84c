#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"
#include "server/rpc/error.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

// A unary call on its pool thread.
struct UnaryCall {
  grpc::CallbackServerContext* context;
  absl::Duration queued;  // how long it waited for the thread

  // By the client or by its deadline: the answer is of no use any more.
  bool cancelled() const { return context->IsCancelled(); }
};

// Answers a unary call with what `handler`, an absl::Status(const UnaryCall&), says on a thread of
// the pool; it fills the response before it returns. UNAVAILABLE when the pool's queue is full.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnPool(grpc::CallbackServerContext* context, WorkerPool& pool,
                                    Handler handler) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Time start = absl::Now();
  const bool taken = pool.Submit([context, reactor, start, handler = std::move(handler)]() mutable {
    const UnaryCall call{context, absl::Now() - start};
    reactor->Finish(call.cancelled() ? ToGrpc(absl::CancelledError("the client is gone"))
                                     : ToGrpc(handler(call)));
  });
  if (!taken) reactor->Finish(ToGrpc(BusyError()));
  return reactor;
}

}  // namespace pepeseg
