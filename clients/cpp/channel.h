#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace pepeseg::client {

// What the command line says of how a server is spoken to. Each path may be empty.
struct Login {
  std::string key_file;     // whose first line is a key or a JWT; else that of PEPESEG_KEY is shown
  std::string ca;           // PEM: who may have signed the server's certificate; else the system's
  std::string certificate;  // PEM, of the client
  std::string certificate_key;  // its private key
  bool tls = false;             // also meant by https://, `ca` and `certificate`
};

// Connects with the first call, and again after a break. The key goes with every call.
// INVALID_ARGUMENT: a file cannot be read, or the key would go to another machine unencrypted.
absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenChannel(const std::string& server,
                                                           const Login& login);

// Whether "host:port" or "unix:path" cannot be another machine.
bool IsThisMachine(const std::string& server);

}  // namespace pepeseg::client
