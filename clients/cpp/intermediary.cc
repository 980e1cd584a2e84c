#include "clients/cpp/intermediary.h"

#include <cstdlib>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client {
namespace {

// gRPC's words for an answer whose HTTP status is not 200.
constexpr char kHttpStatus[] = "Received http2 header with status: ";
// For one without a status of gRPC, as a web page.
constexpr char kNoStatus[] = "Stream removed";
// And for a server of HTTP/1.
constexpr char kHttp1[] = "http1.x server";

struct HttpMeaning {
  int status;
  absl::StatusCode code;
  const char* words;
};

constexpr HttpMeaning kMeanings[] = {
    {401, absl::StatusCode::kUnauthenticated, "it asks for a key or a token"},
    {403, absl::StatusCode::kPermissionDenied, "it does not let this call through"},
    {404, absl::StatusCode::kUnavailable, "it knows no pepeseg server"},
    {405, absl::StatusCode::kUnavailable, "it knows no pepeseg server"},
    {407, absl::StatusCode::kPermissionDenied, "it is a proxy that wants a login of its own"},
    {408, absl::StatusCode::kUnavailable, "the call did not reach it in time"},
    {413, absl::StatusCode::kResourceExhausted, "the call is too large for it"},
    {415, absl::StatusCode::kUnavailable, "it is no gRPC server"},
    {429, absl::StatusCode::kResourceExhausted, "too many calls in too short a time"},
    {431, absl::StatusCode::kResourceExhausted, "the call's headers are too large for it"},
    {502, absl::StatusCode::kUnavailable, "it got no answer from the server"},
    {503, absl::StatusCode::kUnavailable, "it has no server that answers now"},
    {504, absl::StatusCode::kUnavailable, "the server did not answer it in time"},
};

absl::Status FromHttp(int http_status) {
  absl::StatusCode code = absl::StatusCode::kUnavailable;
  const char* words = "which no pepeseg server does";
  for (const HttpMeaning& meaning : kMeanings) {
    if (meaning.status != http_status) continue;
    code = meaning.code;
    words = meaning.words;
  }
  return {code, absl::StrCat("a proxy on the way to the server answered with HTTP ", http_status,
                             ": ", words)};
}

}  // namespace

absl::Status FromIntermediary(const absl::Status& status) {
  const std::string message(status.message());
  const size_t at = message.find(kHttpStatus);
  if (at != std::string::npos) return FromHttp(std::atoi(&message[at + sizeof(kHttpStatus) - 1]));
  if (status.code() == absl::StatusCode::kUnknown && message == kNoStatus) {
    return absl::UnavailableError(
        "the answer is no gRPC: it is of a proxy on the way to the server, or of another program");
  }
  if (absl::StrContains(message, kHttp1)) {
    return absl::UnavailableError("what listens there speaks HTTP/1, so it is no pepeseg server");
  }
  return status;
}

}  // namespace pepeseg::client
