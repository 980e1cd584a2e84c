#include "server/rpc/call_runner.h"

#include <chrono>
#include <string>

#include "server/api/error.h"
#include "server/observe/log.h"
#include "server/rpc/call_interceptor.h"

namespace pepeseg {
namespace {

std::string MetadataOf(const grpc::CallbackServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  if (found == context.client_metadata().end()) return "";
  return {found->second.data(), found->second.size()};
}

// Returns the fields for log lines about a call. The interceptor has given each call this metadata.
LogFields FieldsOf(const grpc::CallbackServerContext& context) {
  LogFields fields;
  fields.request_id = MetadataOf(context, kRequestIdKey);
  const auto trace = ParseTraceparent(TraceparentOf(context));
  if (trace) fields.trace_id = trace->trace_id;
  return fields;
}

// See CallRunner::Pending::credential.
std::optional<std::string> CredentialOf(const grpc::CallbackServerContext& context) {
  if (context.client_metadata().contains("x-pepeseg-project")) return std::nullopt;
  return MetadataOf(context, "authorization");
}

}  // namespace

absl::Duration Stopwatch::Lap() {
  const absl::Time now = absl::Now();
  const absl::Duration lap = now - start_;
  start_ = now;
  return lap;
}

bool UnaryRequest::past_deadline() const {
  return context->deadline() < std::chrono::system_clock::now();
}

absl::Status UnaryRequest::CheckWanted() const {
  if (past_deadline()) return absl::DeadlineExceededError("the call's deadline has passed");
  if (context->IsCancelled()) return absl::CancelledError("the client is gone");
  return absl::OkStatus();
}

std::string TraceparentOf(const grpc::CallbackServerContext& context) {
  return MetadataOf(context, kTraceparentKey);
}

bool CallRunner::AdmitAtOnce(const WorkerPool& pool, Pending& call) const {
  if (pool.draining()) {
    call.reactor->Finish(ToGrpc(DrainingError()));
    return false;
  }
  call.credential = CredentialOf(*call.request.context);
  if (!call.credential) return true;
  // On gRPC's thread, so it must not block: only quotas in memory are asked. A flood of one project
  // is refused here without taking places in the pool's queue.
  const std::optional<absl::Status> known =
      quotas_.AdmitAtOnce(*call.credential, *call.request.message);
  call.admitted = known.has_value();
  if (!known || known->ok()) return true;
  call.reactor->Finish(ToGrpc(*known));
  return false;
}

void CallRunner::Answer(WorkerPool& pool, const Pending& call,
                        absl::FunctionRef<absl::Status(const Caller&)> handler) const {
  const UnaryRequest& request = call.request;
  const auto answer = [&](const Caller& caller) -> absl::Status {
    // Only now is the credential known to be valid.
    if (call.credential) quotas_.Know(*call.credential, caller.project, *request.message);
    absl::Status status;
    if (!call.admitted) status = quotas_.Admit(caller.project, *request.message);
    return status.ok() ? handler(caller) : status;
  };
  // The call may have waited in the queue for longer than its client.
  absl::Status status = request.CheckWanted();
  if (status.ok()) {
    const LogFields fields = FieldsOf(*request.context);
    const LogScope scope(fields);
    const absl::Time start = absl::Now();
    status = authorizer_.Run(OriginOf(*request.context), *request.message, answer);
    const absl::Time end = absl::Now();
    pool.latencies().Record(end - start, end);
    // A handler that stopped for a deadline may say CANCELLED, but the client should read
    // DEADLINE_EXCEEDED.
    if (absl::IsCancelled(status) && request.past_deadline()) status = request.CheckWanted();
  }
  call.reactor->Finish(ToGrpc(status));
}

void CallRunner::FinishBusy(grpc::ServerUnaryReactor* reactor) {
  static const grpc::Status busy = ToGrpc(BusyError());
  reactor->Finish(busy);
}

}  // namespace pepeseg
