#include "server/listen_rules.h"

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/access/access_options.h"

namespace pepeseg {
namespace {

// Returns the likely cause of a failed bind, and the remedy.
std::string BindFault(const std::string& host, int error) {
  switch (error) {
    case EADDRINUSE:
      return absl::StrCat(
          "the port is in use, most likely by another pepesegd: stop that one, or choose another "
          "port, such as ",
          host, ":0 for any that is free");
    case EACCES:
      return "ports below 1024 are for privileged programs: choose another port";
    case EADDRNOTAVAIL:
      return "the host is not an address of this machine: choose one that is";
    default:
      return std::generic_category().message(error);
  }
}

// Binds a socket as gRPC does, and closes it. Returns 0, or the errno.
int TryBind(const addrinfo& address) {
  const int descriptor = socket(address.ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (descriptor < 0) return errno;
  const int on = 1;
  setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
  const int error = bind(descriptor, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
  close(descriptor);
  return error;
}

// Checks one address. `flag` is named in the message.
absl::Status CheckAddressFree(const char* flag, const std::string& listen) {
  const size_t colon = listen.rfind(':');
  if (colon == std::string::npos || listen.find('/') != std::string::npos ||
      listen.rfind("unix", 0) == 0) {
    return absl::OkStatus();
  }
  const std::string host = listen.substr(0, colon);
  const bool in_brackets = host.size() > 2 && host.front() == '[' && host.back() == ']';
  const std::string name = in_brackets ? host.substr(1, host.size() - 2) : host;
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int unknown = getaddrinfo(name.c_str(), listen.c_str() + colon + 1, &hints, &found);
  if (unknown != 0) {
    return absl::UnavailableError(absl::StrCat(flag, " ", listen, ": ", gai_strerror(unknown)));
  }
  const int error = TryBind(*found);
  freeaddrinfo(found);
  if (error == 0) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(flag, " ", listen, ": ", BindFault(host, error)));
}

}  // namespace

bool IsLoopback(const std::string& listen) {
  if (listen.rfind("unix:", 0) == 0) return true;
  const size_t colon = listen.rfind(':');
  if (colon == std::string::npos) return false;
  const std::string host = listen.substr(0, colon);
  if (host == "localhost" || host == "[::1]") return true;
  // All of 127.0.0.0/8, but not a host name that begins with "127.".
  return host.rfind("127.", 0) == 0 && host.find_first_not_of("0123456789.") == std::string::npos;
}

absl::Status CheckAddressesFree(const ServerOptions& options) {
  RETURN_IF_ERROR(CheckAddressFree("--listen", options.listen));
  RETURN_IF_ERROR(CheckAddressFree("--admin", options.admin));
  return CheckAddressFree("--metrics", options.metrics);
}

absl::Status CheckListeners(const ServerOptions& options) {
  RETURN_IF_ERROR(CheckCertificateOptions(options.access));
  if (!options.metrics.empty() && !options.insecure && !IsLoopback(options.metrics)) {
    return absl::FailedPreconditionError(
        absl::StrCat("metrics on ", options.metrics,
                     " go over plain HTTP: use a loopback address, or --insecure if the network is "
                     "trusted"));
  }
  for (const std::string& listen : {options.listen, options.admin}) {
    if (listen.empty() || options.insecure || IsLoopback(listen)) continue;
    if (options.access.tls_certificate.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("listening on ", listen,
                       " would let other machines in without encryption: use a loopback address, "
                       "--tls-certificate and --tls-key, or --insecure if the network is trusted"));
    }
    if (!options.access.require_keys) {
      return absl::FailedPreconditionError(
          absl::StrCat("listening on ", listen,
                       " would let anybody make any call: use a loopback address, "
                       "--require-keys, or --insecure if the network is trusted"));
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
