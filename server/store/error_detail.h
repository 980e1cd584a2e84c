#pragma once

#include <google/protobuf/any.pb.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

// What an error says to programs, in addition to its code and message. Empty texts are not sent.
struct ErrorDetail {
  std::string reason;         // upper-case name that does not change: ErrorInfo.reason
  std::string field = {};     // path of the request's field
  std::string resource = {};  // name of the resource that is missing or prevents the call
  std::string limit = {};     // the exceeded limit, with its unit
  std::string value = {};     // the value that exceeds it
  std::optional<absl::Duration> retry_after = {};  // none: waiting does not help

  bool operator==(const ErrorDetail&) const = default;
};

// Returns `status` with a detail for its client. A status has at most one: the first one stays. It
// travels as payloads under the type URLs of google.rpc, in the form in which it is sent.
absl::Status WithDetail(absl::Status status, const ErrorDetail& detail);
// Returns the detail of WithDetail; its reason is empty if there is none.
ErrorDetail DetailOf(const absl::Status& status);

// Packs a detail as ErrorInfo and, where they apply, BadRequest, ResourceInfo and RetryInfo.
// `description`: what is wrong with the field, for people; may be empty.
std::vector<google::protobuf::Any> PackDetail(const ErrorDetail& detail,
                                              std::string_view description = "");
// Returns the detail that PackDetail has packed. Other messages are passed over.
ErrorDetail UnpackDetail(const google::protobuf::RepeatedPtrField<google::protobuf::Any>& packed);

// Returns the kind of the resource with that name, such as "pepeseg.v1.Job" for "jobs/j1"; "file"
// for any other name, which is the path of a file in a dataset.
std::string ResourceTypeOf(std::string_view name);

}  // namespace pepeseg
