#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "grpcpp/support/status.h"
#include "pepeseg/v1/errors.pb.h"

namespace pepeseg {

// `status` with the detail that its client shall get; no more than one, the first stays.
absl::Status WithDetail(absl::Status status, const v1::ErrorDetail& detail);

// INVALID_ARGUMENT "FIELD: VALUE: WHAT", with the parts in the detail.
absl::Status BadField(const std::string& field, const std::string& value, const std::string& what);

// The same, about a resource in the way or missing, by its name.
absl::Status WithResource(const absl::Status& status, const std::string& reason,
                          const std::string& resource);

// UNAVAILABLE, to be asked again in a second.
absl::Status BusyError();
absl::Status DrainingError();
// RESOURCE_EXHAUSTED, to be asked again in 5 s: `whose` ("the server") streams are all open.
absl::Status TooManyStreamsError(const std::string& whose, size_t limit);
// DEADLINE_EXCEEDED: the client of a stream has neither sent nor taken a message for `limit`.
absl::Status TooSlowError(absl::Duration limit);

// The same code, the message cut so that all of it stays under 4 KB in the trailers, and the detail
// that WithDetail left, or one that holds the code's name only.
// A PrivateError has a second detail, for HidePrivateText, which all pass before they leave.
v1::Status ToProto(const absl::Status& status);
grpc::Status ToGrpc(const absl::Status& status);
bool IsMarkedPrivate(const v1::Status& status);

// Reason of RESOURCE_EXHAUSTED where the disk is full.
inline constexpr char kDiskFull[] = "DISK_FULL";

// `text` without bytes that are not UTF-8 and not longer than `max_bytes`: gRPC and protobuf refuse
// others.
std::string Utf8Prefix(std::string_view text, size_t max_bytes);

}  // namespace pepeseg
