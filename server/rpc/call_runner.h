#pragma once

#include <google/protobuf/message.h>

#include <optional>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/server_context.h"
#include "grpcpp/support/server_callback.h"
#include "server/access/authorizer.h"
#include "server/access/project_quotas.h"
#include "server/observe/log.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

class StreamRegistry;

// A unary call as it arrived.
struct UnaryRequest {
  grpc::CallbackServerContext* context;
  const google::protobuf::Message* message;

  // Returns OK while the client waits for the answer; else CANCELLED or DEADLINE_EXCEEDED. Handlers
  // ask between expensive steps.
  absl::Status CheckWanted() const;
  bool past_deadline() const;
};

// A unary call on its pool thread, authorised.
struct UnaryCall : UnaryRequest {
  absl::Duration queued;  // how long it waited for the thread
  const Caller& caller;
};

// Measures the parts of a call, one after the other.
class Stopwatch {
 public:
  // Returns the time since the last lap, or since construction.
  absl::Duration Lap();

 private:
  absl::Time start_ = absl::Now();
};

// Returns the W3C trace context of a call. The interceptor makes one for calls that bring none.
std::string TraceparentOf(const grpc::CallbackServerContext& context);

// Runs the calls of a server's services: lets the authorizer and the quotas admit them and answers
// them on the threads of a pool. Streams use the same parts (stream.h). Thread safe; the parts must
// outlive it.
class CallRunner {
 public:
  CallRunner(Authorizer& authorizer, ProjectQuotas& quotas, StreamRegistry& streams,
             WorkerPools& pools)
      : authorizer_(authorizer), quotas_(quotas), streams_(streams), pools_(pools) {}

  // Answers a unary call with the status that `handler`, an absl::Status(const UnaryCall&), returns
  // on a thread of the pool. The handler fills the response before it returns. It is not called if
  // the authorizer or the quotas refuse the call, nor if the call was cancelled or its deadline
  // passed while it was queued. Quotas that are known refuse a call before it waits for a thread.
  // UNAVAILABLE: the pool's queue is full, or it drains.
  template <typename Handler>
  grpc::ServerUnaryReactor* Run(WorkerPool& pool, const UnaryRequest& request,
                                Handler handler) const {
    Pending call{request, request.context->DefaultReactor()};
    grpc::ServerUnaryReactor* const reactor = call.reactor;
    if (!AdmitAtOnce(pool, call)) return reactor;
    const bool taken =
        pool.Submit([this, &pool, call = std::move(call), handler = std::move(handler)]() mutable {
          const absl::Duration queued = absl::Now() - call.start;
          Answer(pool, call, [&](const Caller& caller) -> absl::Status {
            return handler(UnaryCall{call.request, queued, caller});
          });
        });
    if (!taken) FinishBusy(reactor);
    return reactor;
  }

  Authorizer& authorizer() const { return authorizer_; }
  ProjectQuotas& quotas() const { return quotas_; }
  StreamRegistry& streams() const { return streams_; }
  WorkerPools& pools() const { return pools_; }

 private:
  // A call that is not answered yet.
  struct Pending {
    UnaryRequest request;
    grpc::ServerUnaryReactor* reactor;
    absl::Time start = absl::Now();
    // What the quotas know the caller by. None: a gateway says who calls, which counts only once
    // the gateway's certificate has been checked.
    std::optional<std::string> credential = {};
    bool admitted = false;  // by the quotas
  };

  // Finishes the call, and returns false, if the pool drains or a known quota refuses the call.
  bool AdmitAtOnce(const WorkerPool& pool, Pending& call) const;
  // Authorises the call, has the handler answer it, and finishes it. On a thread of the pool.
  void Answer(WorkerPool& pool, const Pending& call,
              absl::FunctionRef<absl::Status(const Caller&)> handler) const;
  static void FinishBusy(grpc::ServerUnaryReactor* reactor);

  Authorizer& authorizer_;
  ProjectQuotas& quotas_;
  StreamRegistry& streams_;
  WorkerPools& pools_;
};

}  // namespace pepeseg
