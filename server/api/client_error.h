#pragma once

#include <filesystem>
#include <string>

#include "grpcpp/support/status.h"
#include "pepeseg/v1/errors.pb.h"

// Removes from errors what their clients must not see.
namespace pepeseg {

// What an error must not show, and what it shows instead.
struct ClientErrorRules {
  std::filesystem::path data_folder;  // absolute
  std::string request_id;             // by which the cause is found in the log; empty: unknown
};

// Replaces the text of INTERNAL, UNKNOWN (which becomes INTERNAL) and PrivateError by a general
// one; a private UNAVAILABLE may be retried after a second. In all other errors it makes paths
// relative to the data directory. Returns whether it has changed anything: then the original
// belongs in the log.
bool HidePrivateText(const ClientErrorRules& rules, v1::Status& status);
bool HidePrivateText(const ClientErrorRules& rules, grpc::Status& status);

}  // namespace pepeseg
