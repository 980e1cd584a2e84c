#include "clients/cpp/answer_status.h"

#include <cstdlib>
#include <string>

#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/types/optional.h"

namespace pepeseg::client {
namespace {

constexpr char kDetailUrl[] = "type.googleapis.com/pepeseg.v1.ErrorDetail";

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

}  // namespace

absl::Status FromGrpc(const grpc::Status& status) {
  if (status.ok()) return absl::OkStatus();
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  // The server's own errors carry an ErrorDetail. A status without one comes from gRPC or from a
  // proxy.
  v1::Status details;
  v1::ErrorDetail detail;
  if (details.ParseFromString(status.error_details()) && details.details_size() > 0 &&
      details.details(0).UnpackTo(&detail)) {
    result.SetPayload(kDetailUrl, absl::Cord(detail.SerializeAsString()));
    return result;
  }
  return FromProxy(result);
}

std::optional<v1::ErrorDetail> DetailOf(const absl::Status& status) {
  const absl::optional<absl::Cord> payload = status.GetPayload(kDetailUrl);
  v1::ErrorDetail detail;
  if (!payload || !detail.ParseFromString(std::string(*payload))) return std::nullopt;
  return detail;
}

}  // namespace pepeseg::client
