#include "server/api/client_error.h"

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

using absl::StatusCode;

// Returns what a client may know about an error whose text is for the log: what it can do next, and
// nothing about files, SQL or other projects.
const char* GeneralText(StatusCode code) {
  switch (code) {
    case StatusCode::kUnavailable:
      return "the server cannot reach its database or open its files now: try again";
    case StatusCode::kResourceExhausted:
      return "the server's disk is full";
    case StatusCode::kDataLoss:
      return "data that the server has stored is damaged";
    case StatusCode::kNotFound:
      return "a file that the server has stored is missing";
    case StatusCode::kAborted:
      return "another call changed the same at the same time: try again";
    default:
      return "a fault of the server";
  }
}

// Returns whether a file's name would continue with `c`: "/data" must not be found in "/data2".
bool IsPartOfName(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-';
}

// Removes the folder from the start of paths. Returns whether it was there.
bool MakeRelative(const std::string& folder, std::string& text) {
  bool changed = false;
  for (size_t at = text.find(folder); at != std::string::npos; at = text.find(folder, at)) {
    const size_t end = at + folder.size();
    // The folder counts only where a path begins and where its own last name ends.
    const bool starts = at == 0 || !(IsPartOfName(text[at - 1]) || text[at - 1] == '/');
    if (!starts || (end < text.size() && IsPartOfName(text[end]))) {
      at = end;
      continue;
    }
    const bool has_more = end + 1 < text.size() && text[end] == '/' && IsPartOfName(text[end + 1]);
    text.replace(at, folder.size() + (has_more ? 1 : 0), has_more ? "" : "the data directory");
    changed = true;
  }
  return changed;
}

void Generalise(const ClientErrorRules& rules, v1::Status& status) {
  auto code = static_cast<StatusCode>(status.code());
  // gRPC answers UNKNOWN when a handler has thrown; clients need not tell the two apart.
  if (code == StatusCode::kUnknown) code = StatusCode::kInternal;
  status.set_code(static_cast<int>(code));
  std::string text = GeneralText(code);
  if (!rules.request_id.empty()) {
    absl::StrAppend(&text, "; its log has the cause under request ", rules.request_id);
  }
  status.set_message(text);
  ErrorDetail detail = UnpackDetail(status.details());
  // The reason may be wrong: NO_SUCH_JOB, for example, although only the database was away.
  if (detail.reason != kDiskFull) detail.reason = absl::StatusCodeToString(code);
  // Value and limit may be numbers of the server, such as the disk's free bytes. Field and resource
  // came from the request.
  detail.value.clear();
  detail.limit.clear();
  if (code == StatusCode::kUnavailable && !detail.retry_after) {
    detail.retry_after = absl::Seconds(1);
  }
  SetDetail(detail, status);
}

}  // namespace

bool HidePrivateText(const ClientErrorRules& rules, v1::Status& status) {
  const auto code = static_cast<StatusCode>(status.code());
  // INTERNAL and UNKNOWN are always general: their texts come from libraries and exceptions.
  if (code == StatusCode::kInternal || code == StatusCode::kUnknown || IsMarkedPrivate(status)) {
    Generalise(rules, status);
    return true;
  }
  const std::string folder = rules.data_folder.string();
  // "/" would be found in every path. A status without details was made by gRPC and has no text of
  // ours.
  if (folder.size() < 2 || status.details_size() == 0) return false;
  ErrorDetail detail = UnpackDetail(status.details());
  bool changed = MakeRelative(folder, *status.mutable_message());
  for (std::string* text : {&detail.resource, &detail.limit, &detail.value}) {
    changed = MakeRelative(folder, *text) || changed;
  }
  // The description of a field is made from the message again.
  SetDetail(detail, status);
  return changed;
}

bool HidePrivateText(const ClientErrorRules& rules, grpc::Status& status) {
  if (status.ok()) return false;
  v1::Status proto;
  // ToGrpc puts the whole status into error_details, with its details.
  if (!proto.ParseFromString(status.error_details()) || proto.details_size() == 0) {
    proto.Clear();  // an error that gRPC itself made
    proto.set_code(status.error_code());
    proto.set_message(status.error_message());
  }
  if (!HidePrivateText(rules, proto)) return false;
  status = {static_cast<grpc::StatusCode>(proto.code()), proto.message(),
            proto.SerializeAsString()};
  return true;
}

}  // namespace pepeseg
