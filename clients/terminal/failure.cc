#include "clients/terminal/failure.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/types/optional.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/channel.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/proxy.h"
#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kExitCodeUrl[] = "pepeseg.cli/exit_code";

// Returns an error that carries its exit code as a payload.
absl::Status WithExitCode(const std::string& message, ExitCode code) {
  absl::Status status = absl::AbortedError(message);
  status.SetPayload(kExitCodeUrl, absl::Cord(std::to_string(code)));
  return status;
}

constexpr char kProgram[] = "pepesegd";

// Returns true if `path` is a file that this user may execute.
bool IsProgram(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

bool IsInPath() {
  const char* path = std::getenv("PATH");
  if (path == nullptr) return false;
  for (const auto folder : absl::StrSplit(path, ':', absl::SkipEmpty())) {
    if (IsProgram(fs::path(std::string(folder)) / kProgram)) return true;
  }
  return false;
}

// Returns a sentence that says how to get a server at address `server`. It has a command if
// `server` is this machine, without TLS, and a server program is found.
std::string StartAdvice(const std::string& server) {
  constexpr char kElsewhere[] = "Name another one with --server host:port.";
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const std::string command =
      !error && server.find(':') != std::string::npos && IsThisMachine(server)
          ? StartCommand(server, self.parent_path())
          : "";
  if (command.empty()) return kElsewhere;
  return absl::StrCat("Start one with `", command,
                      "`, or name another one with --server host:port.");
}

// Returns the remedy for a refused key, by ErrorDetail::reason; "" for another reason.
std::string PermissionAdvice(const std::string& reason) {
  if (reason == "NO_KEY") {
    return "Give one with --key-file FILE or in PEPESEG_KEY; the server's operator makes keys with "
           "`pepesegd keys create`.";
  }
  if (reason == "BAD_KEY") return "Ask the server's operator for another one.";
  if (reason == "MISSING_SCOPE")
    return "Ask the server's operator for a key, or a token, that has it.";
  if (reason == "NOT_YOURS") {
    return "It does not exist, or is another project's: `pepeseg scenes` lists the scenes of this "
           "key.";
  }
  return "";
}

// Returns when to try again; "" if the server's error does not say.
std::string RetryAdvice(const ErrorDetail& detail) {
  if (!detail.retry_after) return "";
  const int64_t seconds = std::max<int64_t>(absl::ToInt64Seconds(*detail.retry_after), 1);
  return absl::StrCat("The server is running but cannot serve this now: try again in ", seconds,
                      " s.");
}

// Returns the remedy for an error without an ErrorDetail, which comes from the gateway or a proxy
// in front of the server (see FromGrpc); "" if none is known.
std::string GatewayAdvice(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnauthenticated:
      return "The gateway in front of the server refused the call. Give a valid key or token with "
             "--key-file FILE or in PEPESEG_KEY; the gateway's operator issues them.";
    case absl::StatusCode::kPermissionDenied:
      return "The gateway in front of the server refused the call. Ask its operator what your key "
             "or token permits.";
    case absl::StatusCode::kResourceExhausted:
      return "This is a limit on the way to the server, such as a gateway's. If it limits calls, "
             "wait "
             "a few seconds; the gateway's operator can raise it.";
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
      if (!absl::StrContains(status.message(), "gateway") &&
          !absl::StrContains(status.message(), "a proxy on the way")) {
        return "";
      }
      return "The gateway or proxy in front of the server is running, but the server does not "
             "answer: try again in a moment, then ask its operator.";
    default:
      return "";
  }
}

// Returns the remedy; "" if the message says enough.
std::string Advice(const absl::Status& status, const std::string& server) {
  if (IsLocalFileError(status) || IsProxyFailure(std::string(status.message()))) return "";
  const std::optional<ErrorDetail> detail = DetailOf(status);
  const std::string resource = detail ? detail->resource : "";
  if (!detail) {
    std::string advice = GatewayAdvice(status);
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
                 ? "Train the scene first: `pepeseg train SCENE`."
                 : "";
    case kNotFound:
      return "`pepeseg scenes` and `pepeseg jobs` list what exists.";
    case kNotPermitted:
      return PermissionAdvice(detail ? detail->reason : "");
    case kCorrupt:
      return "Bytes were damaged in transit or on the disk: run the command again.";
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
  if (const std::optional<ErrorDetail> detail = DetailOf(status)) {
    if (!detail->limit.empty() && text.find(detail->limit) == std::string::npos) {
      absl::StrAppend(&text, " (limit: ", detail->limit, ")");
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
  if (const std::optional<ErrorDetail> detail = DetailOf(status)) {
    error["reason"] = detail->reason;
    if (!detail->field.empty()) error["field"] = detail->field;
    if (!detail->resource.empty()) error["resource"] = detail->resource;
    if (!detail->limit.empty()) error["limit"] = detail->limit;
    if (!detail->value.empty()) error["value"] = detail->value;
  }
  return nlohmann::ordered_json{{"error", error}}.dump(
      -1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string StartCommand(const std::string& server, const fs::path& folder) {
  std::string command;
  if (IsProgram(folder / kProgram)) {
    command = Quoted((folder / kProgram).string());
  } else if (IsInPath()) {
    command = kProgram;
  } else {
    return "";
  }
  if (server != Shell().server) absl::StrAppend(&command, " --listen ", Quoted(server));
  return command;
}

}  // namespace pepeseg::client::cli
