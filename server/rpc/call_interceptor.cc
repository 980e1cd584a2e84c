#include "server/rpc/call_interceptor.h"

#include <google/protobuf/message.h>
#include <spdlog/spdlog.h>

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/api/error.h"
#include "server/observe/log.h"

namespace pepeseg {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

// A unary call that took longer is logged at a level that operators see.
constexpr absl::Duration kSlow = absl::Seconds(10);

class CallInterceptor final : public grpc::experimental::Interceptor {
 public:
  // `check` is null unless the call is one of reflection. All must outlive the interceptor, as gRPC
  // keeps `info`.
  CallInterceptor(RpcMetrics& metrics, const std::filesystem::path& data_folder,
                  const ReflectionCheck* check, ServerRpcInfo& info)
      : metrics_(metrics),
        data_folder_(data_folder),
        check_(check),
        info_(info),
        method_(metrics.Find(info.method())),
        unary_(info.type() == ServerRpcInfo::Type::UNARY) {
    metrics_.Begin(method_);
  }
  ~CallInterceptor() override {
    // gRPC has dropped the call: its client has not seen a status of ours.
    if (!answered_) Answered(grpc::Status(grpc::StatusCode::CANCELLED, "dropped"));
    metrics_.End(method_);
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      Identify(methods->GetRecvInitialMetadata());
      if (check_ != nullptr) refused_ = (*check_)(*info_.server_context());
    }
    if (!refused_.ok() &&
        methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE)) {
      // gRPC's own services have protobuf messages, too. Null: the client sends no more of them.
      auto* request = static_cast<google::protobuf::Message*>(methods->GetRecvMessage());
      if (request != nullptr) request->Clear();
    }
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      auto* metadata = methods->GetSendInitialMetadata();
      if (metadata != nullptr && !request_id_.empty()) {
        metadata->emplace(kRequestIdKey, request_id_);
      }
    }
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      // The log gets the status as the handler made it, the client the one without private text.
      const grpc::Status status = refused_.ok() ? methods->GetSendStatus() : refused_;
      grpc::Status sent = status;
      const bool hidden = HidePrivateText({data_folder_, request_id_}, sent);
      if (hidden || !refused_.ok()) methods->ModifySendStatus(sent);
      Answered(status, hidden);
    }
    methods->Proceed();
  }

 private:
  using Metadata = std::multimap<grpc::string_ref, grpc::string_ref>;

  // Replaces malformed metadata by ids that this object holds, which lives as long as the call.
  void Identify(Metadata* metadata) {
    if (metadata == nullptr) return;
    request_id_ = TextOf(*metadata, kRequestIdKey);
    // A client's id goes into the log and into answers, so it must have the form of one.
    if (!IsRequestId(request_id_)) request_id_ = NewRequestId();
    const auto trace = ParseTraceparent(TextOf(*metadata, kTraceparentKey));
    // The call is a span of the client's trace, or begins a trace. Handlers and jobs find both
    // values in the metadata, which this replaces.
    const TraceContext own = trace ? ChildOf(*trace) : NewTrace();
    trace_id_ = own.trace_id;
    traceparent_ = own.ToString();
    Put(*metadata, kRequestIdKey, request_id_);
    Put(*metadata, kTraceparentKey, traceparent_);
  }

  // Returns the value of the key, or "" if there is none or more than one.
  static std::string TextOf(const Metadata& metadata, const char* key) {
    const auto found = metadata.find(key);
    if (found == metadata.end() || metadata.count(key) != 1) return "";
    return {found->second.data(), found->second.size()};
  }

  // The map has references: `value` must live as long as the call.
  static void Put(Metadata& metadata, const char* key, const std::string& value) {
    metadata.erase(key);
    metadata.emplace(key, value);
  }

  // `hidden`: the client gets a general text, so that only the log has this one.
  void Answered(const grpc::Status& status, bool hidden = false) {
    if (answered_) return;
    answered_ = true;
    const absl::Duration took = absl::Now() - start_;
    metrics_.Answer(method_, status.error_code(), took);
    const auto level = LevelOf(status.error_code(), took, hidden);
    if (!spdlog::should_log(level)) return;
    const std::string code = CodeName(status.error_code());
    const LogFields fields = {request_id_, trace_id_, "", RpcMetrics::NameOf(method_), code, took};
    const LogScope scope(fields);
    spdlog::log(level, "{}: {} after {:.6f} s, request {}{}{}", fields.method, code,
                absl::ToDoubleSeconds(took), request_id_, status.ok() ? "" : ": ",
                absl::Utf8SafeCEscape(status.error_message()));
  }

  // A stream lasts for as long as its client wants it, so only unary calls can be slow.
  spdlog::level::level_enum LevelOf(int code, absl::Duration took, bool hidden) const {
    const bool fault = code == grpc::StatusCode::INTERNAL || code == grpc::StatusCode::UNKNOWN ||
                       code == grpc::StatusCode::DATA_LOSS;
    // Only the log has the cause of such an error, so it is written at a level that operators see.
    if (hidden) return fault ? spdlog::level::err : spdlog::level::warn;
    return fault || (unary_ && took > kSlow) ? spdlog::level::info : spdlog::level::debug;
  }

  RpcMetrics& metrics_;
  const std::filesystem::path& data_folder_;
  const ReflectionCheck* const check_;
  ServerRpcInfo& info_;
  RpcMetrics::Method& method_;
  const bool unary_;
  const absl::Time start_ = absl::Now();
  bool answered_ = false;
  std::string request_id_, trace_id_, traceparent_;
  grpc::Status refused_;  // by check_; OK: it is not
};

class CallInterceptors final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  CallInterceptors(RpcMetrics& metrics, std::filesystem::path data_folder,
                   ReflectionCheck reflection)
      : metrics_(metrics),
        data_folder_(std::move(data_folder)),
        reflection_(std::move(reflection)) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* info) override {
    const bool is_reflection = absl::StartsWith(info->method(), "/grpc.reflection.");
    const ReflectionCheck* check = is_reflection && reflection_ ? &reflection_ : nullptr;
    return new CallInterceptor(metrics_, data_folder_, check, *info);  // gRPC deletes it
  }

 private:
  RpcMetrics& metrics_;
  const std::filesystem::path data_folder_;
  const ReflectionCheck reflection_;
};

}  // namespace

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallInterceptors(
    RpcMetrics& metrics, std::filesystem::path data_folder, ReflectionCheck reflection) {
  return std::make_unique<CallInterceptors>(metrics, std::move(data_folder), std::move(reflection));
}

}  // namespace pepeseg
