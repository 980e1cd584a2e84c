#pragma once

#include <chrono>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"
#include "server/log.h"
#include "server/rpc/error.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

// A unary call on its pool thread.
struct UnaryCall {
  grpc::CallbackServerContext* context;
  absl::Duration queued;  // how long it waited for the thread

  // By the client or by its deadline: the answer is of no use any more.
  bool cancelled() const { return context->IsCancelled() || past_deadline(); }
  bool past_deadline() const { return context->deadline() < std::chrono::system_clock::now(); }
  // CANCELLED or DEADLINE_EXCEEDED then.
  absl::Status CheckWanted() const;
};

// Fields of lines about a call: the interceptor has seen to it that each has such metadata.
LogFields FieldsOf(const grpc::CallbackServerContext& context);

// Its W3C trace context, likewise.
std::string TraceparentOf(const grpc::CallbackServerContext& context);

// Runs the handler of a call that is still wanted; the status that it shall end with.
absl::Status AnswerCall(const UnaryCall& call, WorkerPool& pool,
                        absl::FunctionRef<absl::Status(const UnaryCall&)> handler);

// Answers a unary call with what `handler`, an absl::Status(const UnaryCall&), says on a thread of
// the pool; it fills the response before it returns. UNAVAILABLE when the pool's queue is full or
// it drains. A call that is cancelled, or whose deadline passes, in the queue is not computed.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnPool(grpc::CallbackServerContext* context, WorkerPool& pool,
                                    Handler handler) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const absl::Time start = absl::Now();
  if (pool.draining()) {
    reactor->Finish(ToGrpc(DrainingError()));
    return reactor;
  }
  const bool taken =
      pool.Submit([context, reactor, start, &pool, handler = std::move(handler)]() mutable {
        reactor->Finish(ToGrpc(AnswerCall({context, absl::Now() - start}, pool, handler)));
      });
  if (!taken) reactor->Finish(ToGrpc(BusyError()));
  return reactor;
}

}  // namespace pepeseg
