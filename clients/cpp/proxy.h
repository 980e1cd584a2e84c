#pragma once

#include <optional>
#include <string>

// The HTTP proxy that the environment names, through which gRPC connects to other machines.
namespace pepeseg::client {

struct Proxy {
  std::string address;   // "host:port", without a login
  std::string variable;  // environment variable that names it, such as "http_proxy"
};

// Returns the proxy through which calls to `target` go: the one that grpc_proxy, https_proxy or
// http_proxy names, in this order. Empty: calls go to `target` itself, because no variable names a
// proxy by http://, `target` is this machine (by loopback address, own address or own name), or
// no_grpc_proxy or no_proxy has its host: by the end of its name, "*", or a range such as
// 10.0.0.0/8. These rules are those of gRPC 1.51 except for own addresses, "*" and ranges, for
// which gRPC would use the proxy.
std::optional<Proxy> ProxyOf(const std::string& target);

// Returns a message that names `proxy` for gRPC's `message` about a connection to `target` that
// failed; "" if `message` is not about a connection.
std::string ExplainProxyFailure(const Proxy& proxy, const std::string& target,
                                const std::string& message);

// Returns true if `message` was made by ExplainProxyFailure.
bool IsProxyFailure(const std::string& message);

}  // namespace pepeseg::client
