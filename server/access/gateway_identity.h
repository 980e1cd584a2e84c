#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace grpc {
class ServerContextBase;
}

namespace pepeseg {

// What the metadata "x-pepeseg-..." of a call say of who calls, and who has sent them.
struct Vouching {
  // Each value of "x-pepeseg-project", "-scopes" and "-subject".
  std::vector<std::string> projects, scopes, subjects;
  // Some metadata begin so, these or others.
  bool is_there = false;
  // Names in the client's certificate that the connection was verified by. Not read for calls that
  // have no such metadata.
  std::vector<std::string> certificate_names;
};
Vouching VouchingOf(const grpc::ServerContextBase& context);

// A caller whom a gateway has identified.
struct VouchedCaller {
  std::string project;  // RFC 1034 label
  int scopes = 0;       // KeyRow::scopes; never SCOPE_OPERATE
  std::string subject;  // printable ASCII, not empty
};

// INVALID_ARGUMENT: one of the three is missing, is there twice or malformed; for the log.
absl::StatusOr<VouchedCaller> ReadVouching(const Vouching& vouching);

}  // namespace pepeseg
