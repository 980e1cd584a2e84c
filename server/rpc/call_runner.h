#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <memory>
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
  const AuthorizedCaller& caller;

  // The scenes that the request names.
  const NamedScenes& scenes() const { return caller.scenes; }
};

// Measures the parts of a call, one after the other.
class Stopwatch {
 public:
  // Returns the time since the last lap, or since construction.
  absl::Duration Lap();

 private:
  absl::Time start_ = absl::Now();
};

// The parts of an answer but for the first one.
struct AnswerParts {
  // Computes the next part, on a pool thread. Returns nullopt if there are more parts, else the
  // status of the call.
  std::function<std::optional<absl::Status>()> next;
  WorkerPool* pool = nullptr;  // that computes them; null: that of the first part
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
  // on a thread of the pool that the contract names for the method. The handler fills the response
  // before it returns. It is not called if the authorizer or the quotas refuse the call, nor if the
  // call was cancelled or its deadline passed while it was queued. Quotas that are known refuse a
  // call before it waits for a thread. UNAVAILABLE: the pool's queue is full, or it drains.
  template <typename Handler>
  grpc::ServerUnaryReactor* Run(const UnaryRequest& request, Handler handler) const {
    WorkerPool& pool = PoolOf(*request.message);
    return Submit(pool, request, [this, &pool, handler = std::move(handler)](const Pending& call) {
      const absl::Duration queued = absl::Now() - call.start;
      const Stopwatch stopwatch;
      Finish(pool, call, stopwatch,
             Authorized(call, [&](const AuthorizedCaller& caller) -> absl::Status {
               return handler(UnaryCall{call.request, queued, caller});
             }));
    });
  }

  // Answers a call like Run, on the given pool and in parts: `handler`, an
  // absl::StatusOr<AnswerParts>(const UnaryCall&), does the first one. The others take their turn
  // in the pool for the caller's project, so that a long answer does not keep a thread from other
  // projects; AnswerParts may name another pool for them. For methods that only read: the audit log
  // does not see how the call ends.
  template <typename Handler>
  grpc::ServerUnaryReactor* RunInParts(WorkerPool& pool, const UnaryRequest& request,
                                       Handler handler) const {
    return Submit(pool, request, [this, &pool, handler = std::move(handler)](const Pending& call) {
      const absl::Duration queued = absl::Now() - call.start;
      auto rest = std::make_shared<Rest>(Rest{call});
      const absl::Status begun =
          Authorized(call, [&](const AuthorizedCaller& caller) -> absl::Status {
            rest->project = caller.project;
            auto parts = handler(UnaryCall{call.request, queued, caller});
            if (parts.ok()) rest->parts = *std::move(parts);
            return parts.status();
          });
      if (!begun.ok()) return Finish(pool, call, rest->stopwatch, begun);
      WorkerPool* const other = rest->parts.pool;
      if (other == nullptr || other == &pool) return Continue(pool, std::move(rest));
      Queue(*other, std::move(rest));
    });
  }

  Authorizer& authorizer() const { return authorizer_; }
  ProjectQuotas& quotas() const { return quotas_; }
  StreamRegistry& streams() const { return streams_; }
  WorkerPools& pools() const { return pools_; }

 private:
  WorkerPool& PoolOf(const google::protobuf::Message& request) const;

  // A call that is not answered yet.
  struct Pending {
    UnaryRequest request;
    grpc::ServerUnaryReactor* reactor;
    absl::Time start = absl::Now();
    // Credential that identifies the caller to the quotas. Unset if a gateway states the identity,
    // because that is trusted only after its certificate is verified.
    std::optional<std::string> credential = {};
    bool admitted = false;  // by the quotas
  };

  // A call that is answered in parts.
  struct Rest {
    Pending call;
    std::string project = {};  // the caller's
    AnswerParts parts = {};
    Stopwatch stopwatch = {};  // since the first part began
  };

  // Has `answer` run on a thread of the pool, unless the call is refused before.
  grpc::ServerUnaryReactor* Submit(WorkerPool& pool, const UnaryRequest& request,
                                   std::function<void(const Pending&)> answer) const;
  // Finishes the call, and returns false, if the pool drains or a known quota refuses the call.
  bool AdmitAtOnce(const WorkerPool& pool, Pending& call) const;
  // Authorises the call and has the handler answer it. On a thread of the pool.
  absl::Status Authorized(const Pending& call,
                          absl::FunctionRef<absl::Status(const AuthorizedCaller&)> handler) const;
  // Computes the next part, and queues the one after it.
  void Continue(WorkerPool& pool, std::shared_ptr<Rest> rest) const;
  // Has the next part computed when it is the project's turn in the pool.
  void Queue(WorkerPool& pool, std::shared_ptr<Rest> rest) const;
  // Ends the call and records its time.
  static void Finish(WorkerPool& pool, const Pending& call, Stopwatch stopwatch,
                     absl::Status status);

  Authorizer& authorizer_;
  ProjectQuotas& quotas_;
  StreamRegistry& streams_;
  WorkerPools& pools_;
};

}  // namespace pepeseg

// In a service with a member `runner_`: declares a unary method, absl::Status METHOD(const
// UnaryCall&, const REQUEST&, RESPONSE*), which may block, and defines the override of gRPC's
// method of the same name, which has CallRunner::Run call it.
// NOLINTBEGIN(bugprone-macro-parentheses): the arguments are types.
#define PEPESEG_UNARY(METHOD, REQUEST, RESPONSE)                                                 \
  absl::Status METHOD(const ::pepeseg::UnaryCall& call, const REQUEST& request,                  \
                      RESPONSE* response) const;                                                 \
  grpc::ServerUnaryReactor* METHOD(grpc::CallbackServerContext* context, const REQUEST* request, \
                                   RESPONSE* response) override {                                \
    return runner_.Run({context, request}, [=, this](const ::pepeseg::UnaryCall& call) {         \
      return METHOD(call, *request, response);                                                   \
    });                                                                                          \
  }
// NOLINTEND(bugprone-macro-parentheses)
