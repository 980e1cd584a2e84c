#include "server/api/error.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/query/scene_model.h"
#include "server/api/convert.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {
namespace {

using absl::StatusCode;

constexpr char kPrivateMark[] = "pepeseg.server/private";  // never sent
// The trailer grpc-message is percent-encoded, up to three times as long; the details are base64.
// They take 4/3 of the message, four texts, a description, and about 350 bytes of names.
constexpr size_t kMaxStatusMessageBytes = 480;
// Limits on each text of a detail, and on the description of a field.
constexpr size_t kMaxValueBytes = 256;
constexpr size_t kMaxDescriptionBytes = 100;

// Returns the detail of a status with a reason, in texts for clients.
ErrorDetail ClientDetail(const absl::Status& status) {
  ErrorDetail detail = DetailOf(status);
  if (detail.reason.empty()) {
    // Every status has a reason, so that clients need not handle its absence: by default the name
    // of the code.
    detail.reason =
        IsNothingThere(status) ? "NOTHING_THERE" : absl::StatusCodeToString(status.code());
  }
  for (std::string* text : {&detail.field, &detail.resource, &detail.limit, &detail.value}) {
    *text = Utf8Prefix(*text, kMaxValueBytes);
  }
  return detail;
}

// Replaces the details, and so a mark, by `detail`; call it after the message is set.
void SetDetail(const ErrorDetail& detail, v1::Status& status) {
  status.clear_details();
  for (google::protobuf::Any& packed :
       PackDetail(detail, Utf8Prefix(status.message(), kMaxDescriptionBytes))) {
    *status.add_details() = std::move(packed);
  }
}

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

std::string Utf8Prefix(std::string_view text, size_t max_bytes) {
  std::string prefix;
  while (!text.empty()) {
    // 0 for bytes that do not begin a valid character: one of them becomes "?". A character is
    // never cut in two.
    const size_t length = Utf8CharacterLength(text);
    const std::string_view character = length == 0 ? "?" : text.substr(0, length);
    if (prefix.size() + character.size() > max_bytes) break;
    prefix.append(character);
    text.remove_prefix(std::max<size_t>(length, 1));
  }
  return prefix;
}

absl::Status BadField(const std::string& field, const std::string& value, const std::string& what) {
  const ErrorDetail detail = {.reason = "BAD_FIELD",
                              .field = Utf8Prefix(field, kMaxValueBytes),
                              .limit = Utf8Prefix(what, kMaxValueBytes),
                              .value = Utf8Prefix(value, kMaxValueBytes)};
  return WithDetail(
      absl::InvalidArgumentError(absl::StrCat(field, ": '", detail.value, "': ", what)), detail);
}

absl::Status AtField(const absl::Status& status, const std::string& field) {
  const std::optional<PromptFault> fault = FaultOf(status);
  if (!fault) return status;
  ErrorDetail detail;
  const bool joins = field.empty() || fault->part.empty() || fault->part[0] == '[';
  detail.field = absl::StrCat(field, joins ? "" : ".", fault->part);
  if (fault->is_number()) return BadField(detail.field, fault->value, fault->limit);
  detail.reason = IsNothingThere(status) ? "NOTHING_THERE" : "BAD_FIELD";
  detail.value = fault->value;
  if (!fault->value.empty()) detail.limit = fault->limit;
  // A message with the value says what it is about.
  const std::string message = fault->value.empty() ? absl::StrCat(detail.field, ": ", fault->limit)
                                                   : std::string(status.message());
  return WithDetail(absl::InvalidArgumentError(message), detail);
}

absl::Status WithResource(const absl::Status& status, const std::string& reason,
                          const std::string& resource) {
  return WithDetail(status, {.reason = reason, .resource = Utf8Prefix(resource, kMaxValueBytes)});
}

absl::Status BusyError() {
  return WithDetail(absl::UnavailableError("too many calls are waiting"),
                    {.reason = "BUSY", .retry_after = absl::Seconds(1)});
}

absl::Status TooManyStreamsError(const std::string& whose, size_t limit) {
  return WithDetail(
      absl::ResourceExhaustedError(absl::StrCat(
          whose, " has ", limit, " streams open, which is the limit; end some or try again later")),
      {.reason = "TOO_MANY_STREAMS",
       .limit = absl::StrCat(limit),
       .retry_after = absl::Seconds(5)});
}

absl::Status TooSlowError(absl::Duration limit) {
  const std::string time = absl::FormatDuration(limit);
  return WithDetail(
      absl::DeadlineExceededError(
          absl::StrCat("the client of the stream has neither sent nor taken a message for ", time)),
      {.reason = "TOO_SLOW", .limit = time});
}

absl::Status DrainingError() {
  return WithDetail(absl::UnavailableError("the server is stopping"),
                    {.reason = "DRAINING", .retry_after = absl::Seconds(2)});
}

absl::Status CheckAnswerSize(size_t num_bytes) {
  if (num_bytes <= kAnswerBytes) return absl::OkStatus();
  return WithDetail(absl::ResourceExhaustedError(absl::StrCat(
                        "the answer has over ", kAnswerBytes, " bytes: ask for fewer views, for ",
                        "frame PIXEL_FRAME_VIEW, or for a smaller max_side")),
                    {.reason = "ANSWER_TOO_LARGE",
                     .limit = absl::StrCat(kAnswerBytes, " bytes"),
                     .value = absl::StrCat(num_bytes, " bytes")});
}

v1::Status ToProto(const absl::Status& status) {
  v1::Status proto;
  if (status.ok()) return proto;
  proto.set_code(static_cast<int>(status.code()));
  proto.set_message(Utf8Prefix(std::string(status.message()), kMaxStatusMessageBytes));
  SetDetail(ClientDetail(status), proto);
  // The mark is the only trace of privacy that survives the conversion. HidePrivateText replaces
  // the details of every marked status, so it never reaches a client.
  if (IsPrivate(status)) proto.add_details()->set_type_url(kPrivateMark);
  return proto;
}

bool IsMarkedPrivate(const v1::Status& status) {
  return std::any_of(status.details().begin(), status.details().end(),
                     [](const auto& detail) { return detail.type_url() == kPrivateMark; });
}

v1::Error FlatError(const v1::Status& status) {
  const ErrorDetail detail = UnpackDetail(status.details());
  v1::Error error;
  error.set_code(status.code());
  error.set_message(status.message());
  error.set_reason(detail.reason);
  error.set_field(detail.field);
  error.set_resource(detail.resource);
  error.set_limit(detail.limit);
  error.set_value(detail.value);
  if (detail.retry_after) *error.mutable_retry_after() = ToProto(*detail.retry_after);
  return error;
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const v1::Status proto = ToProto(status);
  return {static_cast<grpc::StatusCode>(proto.code()), proto.message(), proto.SerializeAsString()};
}

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
