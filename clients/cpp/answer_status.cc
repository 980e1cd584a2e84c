#include "clients/cpp/answer_status.h"

#include <cstdlib>
#include <string>

#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/types/optional.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg::client {
namespace {

// Details have the names of google.rpc, so that other tools decode them, and our messages of the
// same fields.
constexpr char kErrorInfo[] = "type.googleapis.com/google.rpc.ErrorInfo";
constexpr char kBadRequest[] = "type.googleapis.com/google.rpc.BadRequest";
constexpr char kResourceInfo[] = "type.googleapis.com/google.rpc.ResourceInfo";
constexpr char kRetryInfo[] = "type.googleapis.com/google.rpc.RetryInfo";
constexpr char kDomain[] = "pepeseg";  // of our server's ErrorInfo

// gRPC's message for an answer whose HTTP status is not 200.
constexpr char kHttpStatus[] = "Received http2 header with status: ";
// gRPC's message for an answer without a gRPC status, such as a web page.
constexpr char kNoStatus[] = "Stream removed";
// Part of gRPC's message for a server that speaks HTTP/1.
constexpr char kHttp1[] = "http1.x server";

struct HttpMeaning {
  int status;
  absl::StatusCode code;
  const char* explanation;  // follows "a proxy on the way to the server answered with HTTP 404: "
};

constexpr HttpMeaning kMeanings[] = {
    {401, absl::StatusCode::kUnauthenticated, "it asks for a key or a token"},
    {403, absl::StatusCode::kPermissionDenied, "it does not let this call through"},
    {404, absl::StatusCode::kUnavailable, "it knows no pepeseg server"},
    {405, absl::StatusCode::kUnavailable, "it knows no pepeseg server"},
    {407, absl::StatusCode::kPermissionDenied, "it demands a login of its own"},
    {408, absl::StatusCode::kUnavailable, "the call did not reach it in time"},
    {413, absl::StatusCode::kResourceExhausted, "the call is too large for it"},
    {415, absl::StatusCode::kUnavailable, "it is not a gRPC server"},
    {429, absl::StatusCode::kResourceExhausted, "too many calls in too short a time"},
    {431, absl::StatusCode::kResourceExhausted, "the call's headers are too large for it"},
    {502, absl::StatusCode::kUnavailable, "it got no answer from the server"},
    {503, absl::StatusCode::kUnavailable, "none of its servers is available now"},
    {504, absl::StatusCode::kUnavailable, "the server did not answer it in time"},
};

absl::Status FromHttp(int http_status) {
  absl::StatusCode code = absl::StatusCode::kUnavailable;
  const char* explanation = "a pepeseg server never answers so";
  for (const HttpMeaning& meaning : kMeanings) {
    if (meaning.status != http_status) continue;
    code = meaning.code;
    explanation = meaning.explanation;
  }
  return {code, absl::StrCat("a proxy on the way to the server answered with HTTP ", http_status,
                             ": ", explanation)};
}

// Translates gRPC's report of an answer by HTTP; returns any other status as it is.
absl::Status FromProxy(const absl::Status& status) {
  const std::string message(status.message());
  const size_t at = message.find(kHttpStatus);
  if (at != std::string::npos) return FromHttp(std::atoi(&message[at + sizeof(kHttpStatus) - 1]));
  if (status.code() == absl::StatusCode::kUnknown && message == kNoStatus) {
    return absl::UnavailableError(
        "the answer is not gRPC: it comes from a proxy on the way to the server, or from another "
        "program");
  }
  if (absl::StrContains(message, kHttp1)) {
    return absl::UnavailableError(
        "the program that listens there speaks HTTP/1: it is not a pepeseg server");
  }
  return status;
}

// Returns the payload with this URL; empty if there is none or it does not parse.
template <typename Message>
std::optional<Message> PayloadOf(const absl::Status& status, const char* url) {
  const absl::optional<absl::Cord> payload = status.GetPayload(url);
  Message message;
  if (!payload || !message.ParseFromString(std::string(*payload))) return std::nullopt;
  return message;
}

// Returns the ErrorInfo of our server; empty if the status is not from it.
std::optional<v1::ErrorInfo> InfoOf(const absl::Status& status) {
  std::optional<v1::ErrorInfo> info = PayloadOf<v1::ErrorInfo>(status, kErrorInfo);
  if (info && info->domain() != kDomain) info.reset();
  return info;
}

// Returns the value of `key`; "" if there is none.
std::string MetadataOf(const v1::ErrorInfo& info, const std::string& key) {
  const auto found = info.metadata().find(key);
  return found == info.metadata().end() ? "" : found->second;
}

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  v1::Status trailer;
  if (trailer.ParseFromString(status.error_details())) {
    for (const auto& detail : trailer.details()) {
      result.SetPayload(detail.type_url(), absl::Cord(detail.value()));
    }
  }
  // The server's own errors have its ErrorInfo. A status without one comes from gRPC or from a
  // proxy.
  return InfoOf(result) ? result : FromProxy(result);
}

std::optional<ErrorDetail> DetailOf(const absl::Status& status) {
  const std::optional<v1::ErrorInfo> info = InfoOf(status);
  if (!info) return std::nullopt;
  ErrorDetail detail;
  detail.reason = info->reason();
  detail.limit = MetadataOf(*info, "limit");
  detail.value = MetadataOf(*info, "value");
  const auto request = PayloadOf<v1::BadRequest>(status, kBadRequest);
  if (request && request->field_violations_size() > 0) {
    detail.field = request->field_violations(0).field();
  }
  if (const auto resource = PayloadOf<v1::ResourceInfo>(status, kResourceInfo)) {
    detail.resource = resource->resource_name();
  }
  const auto retry = PayloadOf<v1::RetryInfo>(status, kRetryInfo);
  if (retry && retry->has_retry_delay()) {
    detail.retry_after = absl::Seconds(retry->retry_delay().seconds()) +
                         absl::Nanoseconds(retry->retry_delay().nanos());
  }
  return detail;
}

}  // namespace pepeseg::client
