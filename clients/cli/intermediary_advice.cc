#include "clients/cli/intermediary_advice.h"

#include "absl/strings/match.h"

namespace pepeseg::client::cli {

std::string IntermediaryAdvice(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnauthenticated:
      return "So says the gateway before the server. Give a key or a token that is valid with "
             "--key-file FILE or in PEPESEG_KEY; who runs the gateway gives them out.";
    case absl::StatusCode::kPermissionDenied:
      return "So says the gateway before the server. Ask who runs it what your key or token is "
             "for.";
    case absl::StatusCode::kResourceExhausted:
      return "It is a limit on the way to the server. Where it is one of calls, wait a few "
             "seconds; "
             "who runs the gateway can raise it.";
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      if (!absl::StrContains(status.message(), "gateway") &&
          !absl::StrContains(status.message(), "a proxy on the way")) {
        return "";
      }
      return "What stands before the server answers, the server does not: try again in a moment, "
             "then ask who runs it.";
    default:
      return "";
  }
}

}  // namespace pepeseg::client::cli
