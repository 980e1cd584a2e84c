#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace pepeseg::client {

// How a client identifies itself and checks the server. Each path may be empty.
struct Login {
  // File whose first line is an API key or a JWT. Empty: the environment variable PEPESEG_KEY, if
  // it is set.
  std::string key_file;
  std::string ca;               // PEM: trusted authorities; empty: those that the system trusts
  std::string certificate;      // PEM: certificate of this client, for mutual TLS
  std::string certificate_key;  // PEM: private key of `certificate`; both or neither are given
  bool tls = false;             // https://, `ca` and `certificate` imply it
};

// Returns a channel to `server`: "[https://]host:port", "http://host:port" or "unix:path". It
// connects with the first call, reconnects after a break, and sends the key with every call. It
// connects to other machines through the proxy that the environment names, if any (see ProxyOf).
// INVALID_ARGUMENT: a key is malformed, http:// comes with what asks for TLS, a certificate lacks
// its private key, or the key would go to another machine unencrypted. A file that cannot be read
// is an error of ReadFile.
absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenChannel(const std::string& server,
                                                           const Login& login);

// Returns true if `server`, "host:port" or "unix:path", can only be this machine.
bool IsThisMachine(const std::string& server);

}  // namespace pepeseg::client
