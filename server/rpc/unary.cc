#include "server/rpc/unary.h"

#include <string>

#include "server/observe/trace_context.h"
#include "server/rpc/call_interceptor.h"

namespace pepeseg {
namespace {

std::string MetadataOf(const grpc::CallbackServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  if (found == context.client_metadata().end()) return "";
  return {found->second.data(), found->second.size()};
}

}  // namespace

absl::Status UnaryRequest::CheckWanted() const {
  if (past_deadline()) return absl::DeadlineExceededError("the call's deadline has passed");
  if (context->IsCancelled()) return absl::CancelledError("the client is gone");
  return absl::OkStatus();
}

LogFields FieldsOf(const grpc::CallbackServerContext& context) {
  LogFields fields;
  fields.request_id = MetadataOf(context, kRequestIdKey);
  const auto trace = ParseTraceparent(TraceparentOf(context));
  if (trace) fields.trace_id = trace->trace_id;
  return fields;
}

std::string TraceparentOf(const grpc::CallbackServerContext& context) {
  return MetadataOf(context, kTraceparentKey);
}

std::optional<std::string> CredentialOf(const grpc::CallbackServerContext& context) {
  if (context.client_metadata().contains("x-pepeseg-project")) return std::nullopt;
  return MetadataOf(context, "authorization");
}

const grpc::Status& BusyStatus() {
  static const grpc::Status busy = ToGrpc(BusyError());
  return busy;
}

absl::Status AnswerCall(const UnaryRequest& request, Authorizer& authorizer, WorkerPool& pool,
                        absl::FunctionRef<absl::Status(const Caller&)> handler) {
  if (absl::Status wanted = request.CheckWanted(); !wanted.ok()) return wanted;
  const LogFields fields = FieldsOf(*request.context);
  const LogScope scope(fields);
  const absl::Time start = absl::Now();
  absl::Status status = authorizer.Run(OriginOf(*request.context), *request.message, handler);
  const absl::Time end = absl::Now();
  pool.latencies().Record(end - start, end);
  if (absl::IsCancelled(status) && request.past_deadline()) return request.CheckWanted();
  return status;
}

}  // namespace pepeseg
