#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace grpc {
class ServerContextBase;
}

namespace pepeseg {

// The metadata "x-pepeseg-..." of a call, by which a gateway says who calls, and the names of
// whoever sent them.
struct GatewayMetadata {
  // All values of "x-pepeseg-project", "-scopes" and "-subject".
  std::vector<std::string> projects, scopes, subjects;
  // The call has metadata whose names begin with "x-pepeseg-": one of these three or another.
  bool present = false;
  // Names in the client certificate by which the connection was verified. Not read for calls
  // without such metadata.
  std::vector<std::string> certificate_names;
};
GatewayMetadata GatewayMetadataOf(const grpc::ServerContextBase& context);

// The identity of a caller, as a gateway has established it.
struct GatewayIdentity {
  std::string project;  // RFC 1034 label
  int scopes = 0;       // as KeyRecord::scopes; never SCOPE_OPERATE
  std::string subject;  // printable ASCII, not empty
};

// Reads the identity in a call's metadata. Does not check who sent it. INVALID_ARGUMENT: one of the
// three values is missing, repeated or malformed.
absl::StatusOr<GatewayIdentity> ReadGatewayIdentity(const GatewayMetadata& gateway);

}  // namespace pepeseg
