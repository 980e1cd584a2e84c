#pragma once

#include <filesystem>
#include <string>

#include "grpcpp/support/status.h"
#include "pepeseg/v1/errors.pb.h"

// What of an error its client gets to see.
namespace pepeseg {

// What an error must not show, and by what its cause is found in the log.
struct ClientErrorRules {
  std::filesystem::path data_folder;  // absolute
  std::string request_id;             // empty: not known
};

// Puts a general text in the place of one that is for the log only: of INTERNAL and UNKNOWN (which
// becomes INTERNAL), and of PrivateError. An UNAVAILABLE of these may be retried after a second. Of
// all others it removes the data directory from paths, so that they are relative to it. Whether it
// has changed anything; then the text that was there belongs in the log.
bool HidePrivateText(const ClientErrorRules& rules, v1::Status& status);
bool HidePrivateText(const ClientErrorRules& rules, grpc::Status& status);

}  // namespace pepeseg
