#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "grpcpp/support/status.h"
#include "pepeseg/v1/errors.pb.h"
#include "server/store/error_detail.h"

// Errors of calls: made with a detail for the client, converted for the wire, and freed from what
// clients must not see.
namespace pepeseg {

// An absl::Status has at most one detail for its client (see WithDetail): the first one stays.

// Returns INVALID_ARGUMENT "FIELD: 'VALUE': WHAT", with the parts in the detail.
absl::Status BadField(const std::string& field, const std::string& value, const std::string& what);

// Returns an error of core's checks of prompts, views and granularities (core/query/prompt.h) with
// its part at or below `field` in the detail: "point 7,5 is outside ...", or "FIELD: WHAT". Other
// statuses stay.
absl::Status AtField(const absl::Status& status, const std::string& field);

// Returns `status` with a detail that names the resource that is missing or in the way.
absl::Status WithResource(const absl::Status& status, const std::string& reason,
                          const std::string& resource);

// Return UNAVAILABLE with a time to retry: 1 s when the queue is full, 2 s when the server drains.
absl::Status BusyError();
absl::Status DrainingError();
// Returns RESOURCE_EXHAUSTED, to be retried in 5 s: `whose`, such as "the server", has `limit`
// streams open.
absl::Status TooManyStreamsError(const std::string& whose, size_t limit);
// Returns DEADLINE_EXCEEDED: the client of a stream has neither sent nor taken a message for
// `limit`.
absl::Status TooSlowError(absl::Duration limit);

// Maximum size of an answer in bytes: what gRPC clients take in one message by default.
inline constexpr size_t kAnswerBytes = size_t{4} << 20;
// Returns RESOURCE_EXHAUSTED for more than kAnswerBytes.
absl::Status CheckAnswerSize(size_t num_bytes);

// Return a status for the wire: the same code, the message cut so that the trailers stay under 4
// KB, and the detail of WithDetail, with the name of the code as its reason if it has none. A
// PrivateError gets a further detail as a mark for HidePrivateText, which all errors pass before
// they are sent.
v1::Status ToProto(const absl::Status& status);
grpc::Status ToGrpc(const absl::Status& status);
bool IsMarkedPrivate(const v1::Status& status);

// Input of HidePrivateText.
struct ClientErrorRules {
  std::filesystem::path data_folder;  // absolute
  std::string request_id;             // shown, to find the cause in the log; empty: unknown
};

// Replaces the text of INTERNAL, UNKNOWN (which becomes INTERNAL) and PrivateError by a general
// one; a private UNAVAILABLE may be retried after a second. In all other errors it makes paths
// relative to the data directory. Returns whether it has changed anything: then the original
// belongs in the log.
bool HidePrivateText(const ClientErrorRules& rules, v1::Status& status);
bool HidePrivateText(const ClientErrorRules& rules, grpc::Status& status);

// Returns an error for the wire as fields, for messages.
v1::Error FlatError(const v1::Status& status);

// Reason of a RESOURCE_EXHAUSTED that says that the disk is full.
inline constexpr char kDiskFull[] = "DISK_FULL";

// Returns `text` with "?" for bytes that are not UTF-8, which gRPC and protobuf refuse, cut at
// `max_bytes`.
std::string Utf8Prefix(std::string_view text, size_t max_bytes);

}  // namespace pepeseg
