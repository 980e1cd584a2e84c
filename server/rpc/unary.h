#pragma once

#include <google/protobuf/message.h>

#include <chrono>
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
#include "server/api/error.h"
#include "server/observe/log.h"
#include "server/rpc/service_context.h"
#include "server/rpc/worker_pool.h"

namespace pepeseg {

// A unary call as it came.
struct UnaryRequest {
  grpc::CallbackServerContext* context;
  const google::protobuf::Message* message;

  // By the client or by its deadline: the answer is of no use any more.
  bool cancelled() const { return context->IsCancelled() || past_deadline(); }
  bool past_deadline() const { return context->deadline() < std::chrono::system_clock::now(); }
  // CANCELLED or DEADLINE_EXCEEDED then.
  absl::Status CheckWanted() const;
};

// A unary call on its pool thread, authorised.
struct UnaryCall : UnaryRequest {
  absl::Duration queued;  // how long it waited for the thread
  const Caller& caller;
};

// Fields of lines about a call: the interceptor has seen to it that each has such metadata.
LogFields FieldsOf(const grpc::CallbackServerContext& context);

// Its W3C trace context, likewise.
std::string TraceparentOf(const grpc::CallbackServerContext& context);

// Runs the handler of a call that is still wanted and that the authorizer lets through; the status
// that it shall end with.
absl::Status AnswerCall(const UnaryRequest& request, Authorizer& authorizer, WorkerPool& pool,
                        absl::FunctionRef<absl::Status(const Caller&)> handler);

// By which quotas know a caller again (ProjectQuotas::AdmitAtOnce). None: a gateway says who calls,
// which counts only once its certificate was looked at.
std::optional<std::string> CredentialOf(const grpc::CallbackServerContext& context);

// BusyError as gRPC sends it, made once: an overload is the time to save work.
const grpc::Status& BusyStatus();

// Answers a unary call with what `handler`, an absl::Status(const UnaryCall&), says on a thread of
// the pool; it fills the response before it returns, and is not asked about a call that the
// context's authorizer or quotas refuse: those, where they can, before it waits for a thread.
// UNAVAILABLE when the pool's queue is full or it drains. A call that is cancelled, or whose
// deadline passes, in the queue is not computed.
template <typename Handler>
grpc::ServerUnaryReactor* RunOn(const UnaryRequest& request, const ServiceContext& services,
                                WorkerPool& pool, Handler handler) {
  grpc::ServerUnaryReactor* reactor = request.context->DefaultReactor();
  const absl::Time start = absl::Now();
  if (pool.draining()) {
    reactor->Finish(ToGrpc(DrainingError()));
    return reactor;
  }
  const std::optional<std::string> credential = CredentialOf(*request.context);
  std::optional<absl::Status> known;
  if (credential) known = services.quotas->AdmitAtOnce(*credential, *request.message);
  if (known.has_value() && !known->ok()) {
    reactor->Finish(ToGrpc(*known));
    return reactor;
  }
  const bool taken = pool.Submit(
      [request, authorizer = services.authorizer, quotas = services.quotas, reactor, start, &pool,
       credential, admitted = known.has_value(), handler = std::move(handler)]() mutable {
        const absl::Duration queued = absl::Now() - start;
        reactor->Finish(ToGrpc(
            AnswerCall(request, *authorizer, pool, [&](const Caller& caller) -> absl::Status {
              if (credential) quotas->Know(*credential, caller.project, *request.message);
              absl::Status status;
              if (!admitted) status = quotas->Admit(caller.project, *request.message);
              if (!status.ok()) return status;
              return handler(UnaryCall{request, queued, caller});
            })));
      });
  if (!taken) reactor->Finish(BusyStatus());
  return reactor;
}

// On the pool for what waits on the disk.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnPool(const UnaryRequest& request, const ServiceContext& services,
                                    Handler handler) {
  return RunOn(request, services, *services.pool, std::move(handler));
}

// On that for what waits on the disk at length: for each of thousands of files.
template <typename Handler>
grpc::ServerUnaryReactor* RunOnUploadPool(const UnaryRequest& request,
                                          const ServiceContext& services, Handler handler) {
  return RunOn(request, services, *services.upload_pool, std::move(handler));
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
