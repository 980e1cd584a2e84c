#include "clients/cpp/proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace pepeseg::client {
namespace {

// Parts of gRPC's messages.
constexpr char kRefused[] = "HTTP proxy returned response code ";
constexpr char kNotConnected[] = "failed to connect to all addresses";
constexpr char kLastError[] = "last error: ";
constexpr char kNoHost[] = "Failed to connect to remote host: ";
constexpr char kNoName[] = "DNS resolution failed for ";

// Part of ours.
constexpr char kRemedy[] = "; to connect without it, add ";

// Returns the host of "host:port", "[host]:port", or one of these after a resolver's scheme.
std::string HostOf(const std::string& target) {
  absl::string_view rest = target;
  for (const char* scheme : {"dns:///", "dns:", "ipv4:", "ipv6:"}) {
    if (absl::ConsumePrefix(&rest, scheme)) break;
  }
  if (absl::ConsumePrefix(&rest, "[")) return std::string(rest.substr(0, rest.find(']')));
  // More than one ':' without brackets is an IPv6 address without a port.
  if (std::count(rest.begin(), rest.end(), ':') > 1) return std::string(rest);
  return std::string(rest.substr(0, rest.find(':')));
}

// An IP address as 16 bytes; an IPv4 address as ::ffff:a.b.c.d.
using Address = std::array<uint8_t, 16>;

std::optional<Address> ParseAddress(const std::string& host) {
  Address address = {};
  if (inet_pton(AF_INET6, host.c_str(), address.data()) == 1) return address;
  address[10] = address[11] = 0xff;
  if (inet_pton(AF_INET, host.c_str(), &address[12]) == 1) return address;
  return std::nullopt;
}

// Returns true if this machine has `address`: only then can a socket be bound to it.
bool IsOwn(const Address& address) {
  const int file = socket(AF_INET6, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (file >= 0) {
    sockaddr_in6 name = {};
    name.sin6_family = AF_INET6;
    std::copy(address.begin(), address.end(), name.sin6_addr.s6_addr);
    const int off = 0;  // lets IPv4 addresses be bound
    setsockopt(file, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off));
    const bool bound = bind(file, reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0;
    close(file);
    if (bound) return true;
  }
  // A machine without IPv6.
  const int file4 = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (file4 < 0) return false;
  sockaddr_in name = {};
  name.sin_family = AF_INET;
  std::copy(address.begin() + 12, address.end(), reinterpret_cast<uint8_t*>(&name.sin_addr));
  const bool is_ipv4 = address[10] == 0xff && address[11] == 0xff;
  const bool bound =
      is_ipv4 && bind(file4, reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0;
  close(file4);
  return bound;
}

bool IsOwnHost(const std::string& host) {
  if (const std::optional<Address> address = ParseAddress(host)) return IsOwn(*address);
  if (absl::EqualsIgnoreCase(host, "localhost") || absl::EqualsIgnoreCase(host, "localhost.")) {
    return true;
  }
  char own[256] = {};
  return gethostname(own, sizeof(own) - 1) == 0 && absl::EqualsIgnoreCase(host, own);
}

// Returns true if `host` is an address of `range`, "address/bits".
bool IsInRange(const std::string& host, const std::string& range) {
  const std::pair<std::string, std::string> parts = absl::StrSplit(range, absl::MaxSplits('/', 1));
  const std::optional<Address> base = ParseAddress(parts.first);
  const std::optional<Address> address = ParseAddress(host);
  int bits = 0;
  if (!base || !address || !absl::SimpleAtoi(parts.second, &bits)) return false;
  const bool is_ipv4 = parts.first.find(':') == std::string::npos;
  if (bits < 0 || bits > (is_ipv4 ? 32 : 128)) return false;
  if (is_ipv4) bits += 96;
  for (int i = 0; i < bits; ++i) {
    const int mask = 0x80 >> (i % 8);
    if (((*base)[i / 8] & mask) != ((*address)[i / 8] & mask)) return false;
  }
  return true;
}

// Returns true if `list`, the value of no_proxy, has `host`.
bool IsListed(const std::string& host, const std::string& list) {
  for (absl::string_view entry : absl::StrSplit(list, ',')) {
    entry = absl::StripAsciiWhitespace(entry);
    if (entry.empty()) continue;
    if (entry == "*" || absl::EndsWithIgnoreCase(host, entry) ||
        IsInRange(host, std::string(entry))) {
      return true;
    }
  }
  return false;
}

// Returns "host:port" of "http://login@host:port/"; "" if `url` is not of this form.
std::string AddressOf(const std::string& url) {
  absl::string_view rest = url;
  if (!absl::StartsWithIgnoreCase(rest, "http://")) return "";
  rest.remove_prefix(7);
  rest = rest.substr(0, rest.find_first_of("/?#"));
  return std::string(rest.substr(rest.rfind('@') + 1));
}

}  // namespace

std::optional<Proxy> ProxyOf(const std::string& target) {
  if (absl::StartsWith(target, "unix:") || absl::StartsWith(target, "unix-abstract:")) {
    return std::nullopt;
  }
  const char* url = nullptr;
  Proxy proxy;
  for (const char* variable : {"grpc_proxy", "https_proxy", "http_proxy"}) {
    url = std::getenv(variable);
    proxy.variable = variable;
    if (url != nullptr) break;  // an empty one counts, too: it means no proxy
  }
  if (url == nullptr) return std::nullopt;
  proxy.address = AddressOf(url);
  const std::string host = HostOf(target);
  if (proxy.address.empty() || IsOwnHost(host)) return std::nullopt;
  const char* list = std::getenv("no_grpc_proxy");
  if (list == nullptr) list = std::getenv("no_proxy");
  if (list != nullptr && IsListed(host, list)) return std::nullopt;
  return proxy;
}

std::string ExplainProxyFailure(const Proxy& proxy, const std::string& target,
                                const std::string& message) {
  const std::string subject =
      absl::StrCat("the proxy ", proxy.address, ", which ", proxy.variable, " names, ");
  const std::string remedy =
      absl::StrCat(kRemedy, HostOf(target), " to ",
                   std::getenv("no_grpc_proxy") != nullptr ? "no_grpc_proxy" : "no_proxy");
  const size_t refused = message.find(kRefused);
  if (refused != std::string::npos) {
    return absl::StrCat(subject, "refused the connection to ", target, " with HTTP ",
                        std::atoi(&message[refused + sizeof(kRefused) - 1]), remedy);
  }
  if (absl::StrContains(message, kNoName)) {
    return absl::StrCat(subject, "cannot be reached: its name could not be resolved", remedy);
  }
  const size_t no_host = message.find(kNoHost);
  if (no_host != std::string::npos) {
    return absl::StrCat(
        subject, "cannot be reached: ", message.substr(no_host + sizeof(kNoHost) - 1), remedy);
  }
  if (!absl::StrContains(message, kNotConnected)) return "";
  const size_t last = message.find(kLastError);
  return absl::StrCat(
      subject, "did not connect to ", target, ": ",
      last == std::string::npos ? message : message.substr(last + sizeof(kLastError) - 1), remedy);
}

bool IsProxyFailure(const std::string& message) {
  return absl::StartsWith(message, "the proxy ") && absl::StrContains(message, " names, ") &&
         absl::StrContains(message, kRemedy);
}

}  // namespace pepeseg::client
