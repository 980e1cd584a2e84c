#include "server/api/error.h"

#include <algorithm>
#include <string>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "core/base/private_error.h"
#include "core/query/check_prompt.h"
#include "server/store/scene_key.h"
#include "server/worker_protocol/client_text.h"

namespace pepeseg {
namespace {

// Payload of a status under which its ErrorDetail travels inside the server.
constexpr char kDetailUrl[] = "type.googleapis.com/pepeseg.v1.ErrorDetail";
constexpr char kPrivateMark[] = "pepeseg.server/private";  // never sent
// The trailer grpc-message is percent-encoded, up to three times as long; the details are base64.
constexpr size_t kMaxStatusMessageBytes = 640;
// Limit on each text of a detail.
constexpr size_t kMaxValueBytes = 256;

v1::ErrorDetail DetailOf(const absl::Status& status) {
  v1::ErrorDetail detail;
  if (const auto payload = status.GetPayload(kDetailUrl)) {
    detail.ParseFromString(std::string(*payload));
  }
  if (detail.reason().empty()) {
    // Every status has a reason, so that clients need not handle its absence: by default the name
    // of the code.
    detail.set_reason(IsNothingThere(status) ? "NOTHING_THERE"
                                             : absl::StatusCodeToString(status.code()));
  }
  for (std::string* text : {detail.mutable_field(), detail.mutable_resource(),
                            detail.mutable_limit(), detail.mutable_value()}) {
    *text = Utf8Prefix(WithSceneIds(*text), kMaxValueBytes);
  }
  return detail;
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

absl::Status WithDetail(absl::Status status, const v1::ErrorDetail& detail) {
  // The innermost caller knows most, so its detail stays when outer ones add theirs.
  if (!status.ok() && !status.GetPayload(kDetailUrl).has_value()) {
    status.SetPayload(kDetailUrl, absl::Cord(detail.SerializeAsString()));
  }
  return status;
}

absl::Status BadField(const std::string& field, const std::string& value, const std::string& what) {
  v1::ErrorDetail detail;
  detail.set_reason("BAD_FIELD");
  detail.set_field(Utf8Prefix(field, kMaxValueBytes));
  detail.set_value(Utf8Prefix(value, kMaxValueBytes));
  detail.set_limit(Utf8Prefix(what, kMaxValueBytes));
  return WithDetail(
      absl::InvalidArgumentError(absl::StrCat(field, ": '", detail.value(), "': ", what)), detail);
}

absl::Status WithResource(const absl::Status& status, const std::string& reason,
                          const std::string& resource) {
  v1::ErrorDetail detail;
  detail.set_reason(reason);
  detail.set_resource(Utf8Prefix(resource, kMaxValueBytes));
  return WithDetail(status, detail);
}

absl::Status BusyError() {
  v1::ErrorDetail detail;
  detail.set_reason("BUSY");
  detail.mutable_retry_after()->set_seconds(1);
  return WithDetail(absl::UnavailableError("too many calls are waiting"), detail);
}

absl::Status TooManyStreamsError(const std::string& whose, size_t limit) {
  v1::ErrorDetail detail;
  detail.set_reason("TOO_MANY_STREAMS");
  detail.set_limit(absl::StrCat(limit));
  detail.mutable_retry_after()->set_seconds(5);
  return WithDetail(
      absl::ResourceExhaustedError(absl::StrCat(
          whose, " has ", limit, " streams open, which is the limit; end some or try again later")),
      detail);
}

absl::Status TooSlowError(absl::Duration limit) {
  v1::ErrorDetail detail;
  detail.set_reason("TOO_SLOW");
  detail.set_limit(absl::FormatDuration(limit));
  return WithDetail(absl::DeadlineExceededError(
                        absl::StrCat("the client of the stream has neither sent nor taken a "
                                     "message for ",
                                     detail.limit())),
                    detail);
}

absl::Status DrainingError() {
  v1::ErrorDetail detail;
  detail.set_reason("DRAINING");
  detail.mutable_retry_after()->set_seconds(2);
  return WithDetail(absl::UnavailableError("the server is stopping"), detail);
}

v1::Status ToProto(const absl::Status& status) {
  v1::Status proto;
  if (status.ok()) return proto;
  proto.set_code(static_cast<int>(status.code()));
  proto.set_message(
      Utf8Prefix(WithSceneIds(std::string(status.message())), kMaxStatusMessageBytes));
  proto.add_details()->PackFrom(DetailOf(status));
  // The mark is the only trace of privacy that survives the conversion. HidePrivateText replaces
  // the details of every marked status, so it never reaches a client.
  if (IsPrivate(status)) proto.add_details()->set_type_url(kPrivateMark);
  return proto;
}

bool IsMarkedPrivate(const v1::Status& status) {
  return status.details_size() > 1 && status.details(1).type_url() == kPrivateMark;
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const v1::Status proto = ToProto(status);
  return {static_cast<grpc::StatusCode>(proto.code()), proto.message(), proto.SerializeAsString()};
}

}  // namespace pepeseg
