#include "server/rpc/call_runner.h"

#include <chrono>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "server/access/method_access.h"
#include "server/api/error.h"
#include "server/observe/log.h"
#include "server/rpc/call_interceptor.h"

namespace pepeseg {
namespace {

// Metadata by which a trusted gateway names the project of a call.
constexpr char kGatewayProjectKey[] = "x-pepeseg-project";

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

// Returns Pending::credential.
std::optional<std::string> CredentialOf(const grpc::CallbackServerContext& context) {
  if (context.client_metadata().contains(kGatewayProjectKey)) return std::nullopt;
  return Sha256Hex(MetadataOf(context, "authorization"));
}

// Returns the owner of a call's first task, before the call is authorised. What a call says of its
// gateway is not verified yet, so such a call waits in no project's own line.
std::string OwnerAtOnce(const grpc::CallbackServerContext& context,
                        const std::optional<std::string>& credential, ProjectQuotas& quotas) {
  if (credential) return quotas.OwnerOf(*credential);
  return absl::StrCat("gateway/", MetadataOf(context, kGatewayProjectKey));
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

WorkerPool& CallRunner::PoolOf(const google::protobuf::Message& request) const {
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  // A method without access is refused on any pool.
  return pools_.Of(access == nullptr ? v1::POOL_IO : access->pool);
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

grpc::ServerUnaryReactor* CallRunner::Submit(WorkerPool& pool, const UnaryRequest& request,
                                             std::function<void(const Pending&)> answer) const {
  Pending call{request, request.context->DefaultReactor()};
  grpc::ServerUnaryReactor* const reactor = call.reactor;
  if (!AdmitAtOnce(pool, call)) return reactor;
  const std::string owner = OwnerAtOnce(*request.context, call.credential, quotas_);
  const auto task = [call = std::move(call), answer = std::move(answer)] {
    // The call may have waited in the queue for longer than its client.
    const absl::Status wanted = call.request.CheckWanted();
    if (!wanted.ok()) return call.reactor->Finish(ToGrpc(wanted));
    answer(call);
  };
  static const grpc::Status busy = ToGrpc(BusyError());
  if (!pool.Submit(owner, task)) reactor->Finish(busy);
  return reactor;
}

absl::Status CallRunner::Authorized(
    const Pending& call, absl::FunctionRef<absl::Status(const AuthorizedCaller&)> handler) const {
  const UnaryRequest& request = call.request;
  const LogFields fields = FieldsOf(*request.context);
  const LogScope scope(fields);
  return authorizer_.Run(OriginOf(*request.context), *request.message,
                         [&](const AuthorizedCaller& caller) -> absl::Status {
                           // Only now is the credential known to be valid.
                           if (call.credential)
                             quotas_.Know(*call.credential, caller.project, *request.message);
                           if (!call.admitted)
                             RETURN_IF_ERROR(quotas_.Admit(caller.project, *request.message));
                           return handler(caller);
                         });
}

void CallRunner::Continue(WorkerPool& pool, std::shared_ptr<Rest> rest) const {
  std::optional<absl::Status> status;
  {
    const LogFields fields = FieldsOf(*rest->call.request.context);
    const LogScope scope(fields);
    status = rest->parts.next();
  }
  if (!status) return Queue(pool, std::move(rest));
  // Before the client has its answer: it may ask for what needs the memory of the model.
  rest->parts.next = nullptr;
  Finish(pool, rest->call, rest->stopwatch, *std::move(status));
}

// Runs the rest here after the pool has stopped, which waits for its tasks.
void CallRunner::Queue(WorkerPool& pool, std::shared_ptr<Rest> rest) const {
  if (pool.SubmitAlways(rest->project, [this, &pool, rest] { Continue(pool, rest); })) return;
  Continue(pool, rest);
}

void CallRunner::Finish(WorkerPool& pool, const Pending& call, Stopwatch stopwatch,
                        absl::Status status) {
  const absl::Duration took = stopwatch.Lap();
  pool.latencies().Record(took, absl::Now());
  // A handler that stopped for a deadline may say CANCELLED, but the client should read
  // DEADLINE_EXCEEDED.
  if (absl::IsCancelled(status) && call.request.past_deadline())
    status = call.request.CheckWanted();
  call.reactor->Finish(ToGrpc(status));
}

}  // namespace pepeseg
