#include "clients/cli/failure.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/types/optional.h"
#include "clients/cli/intermediary_advice.h"
#include "clients/cli/start_advice.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/file_bytes.h"

namespace pepeseg::client::cli {
namespace {

constexpr char kExitCodeUrl[] = "pepeseg.cli/exit_code";

absl::Status WithExitCode(const std::string& message, ExitCode code) {
  absl::Status status = absl::AbortedError(message);
  status.SetPayload(kExitCodeUrl, absl::Cord(std::to_string(code)));
  return status;
}

std::string PermissionAdvice(const std::string& reason) {
  if (reason == "NO_KEY") {
    return "Give one with --key-file FILE or in PEPESEG_KEY; who runs the server makes it with "
           "`pepesegd keys create`.";
  }
  if (reason == "BAD_KEY") return "Ask who runs the server for another one.";
  if (reason == "MISSING_SCOPE")
    return "Ask who runs the server for a key, or a token, that has it.";
  if (reason == "NOT_YOURS") {
    return "It does not exist, or is another project's: see what the key opens with `pepeseg "
           "scenes`.";
  }
  return "";
}

// Says when to try again, if the server's error does.
std::string RetryAdvice(const v1::ErrorDetail& detail) {
  if (!detail.has_retry_after()) return "";
  const int64_t seconds = std::max<int64_t>(detail.retry_after().seconds(), 1);
  return absl::StrCat("The server answers, but not this now: try again in ", seconds, " s.");
}

// What to do next, by kind of failure; empty where the message says it all.
std::string Advice(const absl::Status& status, const std::string& server) {
  if (IsLocalFileError(status)) return "";
  const std::optional<v1::ErrorDetail> detail = DetailOf(status);
  const std::string resource = detail ? detail->resource() : "";
  if (!detail) {
    std::string advice = IntermediaryAdvice(status);
    if (!advice.empty()) return advice;
  }
  switch (ExitCodeOf(status)) {
    case kNoServer:
      return detail ? RetryAdvice(*detail)
                    : absl::StrCat("Is a server listening at ", server, "? ", StartAdvice(server));
    case kNotNow:
      if (resource.rfind("jobs/", 0) == 0) {
        return absl::StrCat("Follow the job with `pepeseg watch ", resource, "`.");
      }
      return status.code() == absl::StatusCode::kFailedPrecondition && resource.empty()
                 ? "A scene answers once it is trained: `pepeseg train SCENE`."
                 : "";
    case kNotFound:
      return "See what there is with `pepeseg scenes` and `pepeseg jobs`.";
    case kNotPermitted:
      return PermissionAdvice(detail ? detail->reason() : "");
    case kCorrupt:
      return "Bytes were damaged on the way or on the disk: run the command again.";
    default:
      return "";
  }
}

}  // namespace

absl::Status JobFailed(const std::string& message) { return WithExitCode(message, kJobFailed); }

absl::Status JobCancelled(const std::string& message) {
  return WithExitCode(message, kJobCancelled);
}

ExitCode ExitCodeOf(const absl::Status& status) {
  if (const absl::optional<absl::Cord> code = status.GetPayload(kExitCodeUrl)) {
    return static_cast<ExitCode>(std::stoi(std::string(*code)));
  }
  if (IsLocalFileError(status)) return absl::IsNotFound(status) ? kNotFound : kRefused;
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return kSuccess;
    case absl::StatusCode::kNotFound:
      return kNotFound;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return kRefused;
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      return kNoServer;
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kAborted:
      return kNotNow;
    case absl::StatusCode::kResourceExhausted:
      return kLimit;
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kPermissionDenied:
      return kNotPermitted;
    case absl::StatusCode::kDataLoss:
      return kCorrupt;
    default:
      return kUnexpected;
  }
}

std::string Explain(const absl::Status& status, const std::string& server) {
  std::string text = absl::StrCat("pepeseg: ", status.message());
  if (status.message().empty()) absl::StrAppend(&text, absl::StatusCodeToString(status.code()));
  if (const std::optional<v1::ErrorDetail> detail = DetailOf(status)) {
    if (!detail->limit().empty() && text.find(detail->limit()) == std::string::npos) {
      absl::StrAppend(&text, " (limit: ", detail->limit(), ")");
    }
  }
  const std::string advice = Advice(status, server);
  return advice.empty() ? text : absl::StrCat(text, "\n", advice);
}

std::string ExplainJson(const absl::Status& status) {
  nlohmann::ordered_json error;
  error["code"] = absl::StatusCodeToString(status.code());
  error["exit_code"] = static_cast<int>(ExitCodeOf(status));
  error["message"] = std::string(status.message());
  if (const std::optional<v1::ErrorDetail> detail = DetailOf(status)) {
    error["reason"] = detail->reason();
    if (!detail->field().empty()) error["field"] = detail->field();
    if (!detail->resource().empty()) error["resource"] = detail->resource();
    if (!detail->limit().empty()) error["limit"] = detail->limit();
    if (!detail->value().empty()) error["value"] = detail->value();
  }
  return nlohmann::ordered_json{{"error", error}}.dump(
      -1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace pepeseg::client::cli
