"""The HTTP proxy that the environment names, through which gRPC connects to other machines."""

from __future__ import annotations

from dataclasses import dataclass
import ipaddress
import os
import re
import socket

_VARIABLES = ("grpc_proxy", "https_proxy", "http_proxy")
_SCHEMES = ("dns:///", "dns:", "ipv4:", "ipv6:")
# Parts of gRPC's messages.
_REFUSED = re.compile(r"HTTP proxy returned response code (\d+)")
_NO_NAME = "DNS resolution failed for "
_NO_HOST = "Failed to connect to remote host: "
_NOT_CONNECTED = "failed to connect to all addresses"
_LAST_ERROR = "last error: "


@dataclass(frozen=True)
class Proxy:
    """The proxy on the way to a server.

    Attributes:
        address: "host:port" of the proxy, without a login.
        variable: environment variable that names it, such as "http_proxy".
        target: "host:port" of the server.
    """

    address: str
    variable: str
    target: str

    def explain(self, message: str) -> str:
        """Returns a message that names the proxy for gRPC's `message` about a connection that
        failed; empty if `message` is not about a connection."""
        if refused := _REFUSED.search(message):
            problem = f"refused the connection to {self.target} with HTTP {refused[1]}"
        elif _NO_NAME in message:
            problem = "cannot be reached: its name could not be resolved"
        elif _NO_HOST in message:
            problem = f"cannot be reached: {message.partition(_NO_HOST)[2]}"
        elif _NOT_CONNECTED in message:
            cause = message.partition(_LAST_ERROR)[2] or message
            problem = f"did not connect to {self.target}: {cause}"
        else:
            return ""
        exceptions = "no_grpc_proxy" if "no_grpc_proxy" in os.environ else "no_proxy"
        return (
            f"the proxy {self.address}, which {self.variable} names, {problem}; to connect without "
            f"it, add {_host_of(self.target)} to {exceptions}"
        )


def _host_of(target: str) -> str:
    """Returns the host of "host:port" or "[host]:port", also after a resolver's scheme."""
    rest = target
    for scheme in _SCHEMES:
        if target.startswith(scheme):
            rest = target.removeprefix(scheme)
            break
    if rest.startswith("["):
        return rest[1:].partition("]")[0]
    # More than one ':' without brackets is an IPv6 address without a port.
    return rest if rest.count(":") > 1 else rest.partition(":")[0]


def _is_own(address: ipaddress.IPv4Address | ipaddress.IPv6Address) -> bool:
    """Returns whether this machine has `address`: only then can a socket be bound to it."""
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    family = socket.AF_INET if address.version == 4 else socket.AF_INET6
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind((str(address), 0))
    except OSError:
        return False
    return True


def _is_own_host(host: str) -> bool:
    try:
        return _is_own(ipaddress.ip_address(host))
    except ValueError:
        return host.lower() in ("localhost", "localhost.", socket.gethostname().lower())


def _is_in_range(host: str, network: str) -> bool:
    try:
        return ipaddress.ip_address(host) in ipaddress.ip_network(network, strict=False)
    except ValueError:
        return False


def _is_listed(host: str, entries: str) -> bool:
    """Returns whether `entries`, the value of no_proxy, has `host`."""
    for entry in (entry.strip() for entry in entries.split(",")):
        if entry and (entry == "*" or host.lower().endswith(entry.lower())):
            return True
        if "/" in entry and _is_in_range(host, entry):
            return True
    return False


def proxy_of(target: str) -> Proxy | None:
    """Returns the proxy through which calls to `target` go; None: they go to `target` itself.

    The proxy is the one that grpc_proxy, https_proxy or http_proxy names, in this order, by
    http://. None is used if `target` is this machine (by loopback address, own address or own
    name), or if no_grpc_proxy or no_proxy has its host: by the end of its name, "*", or a range
    such as 10.0.0.0/8. These rules are those of gRPC 1.51 except for own addresses, "*" and ranges,
    for which gRPC would use the proxy.
    """
    variable = next((name for name in _VARIABLES if name in os.environ), None)
    if variable is None or target.startswith(("unix:", "unix-abstract:")):
        return None
    found = re.match(r"http://(?:[^/?#]*@)?([^/?#@]+)", os.environ[variable], re.IGNORECASE)
    host = _host_of(target)
    exceptions = os.environ.get("no_grpc_proxy", os.environ.get("no_proxy", ""))
    if found is None or _is_own_host(host) or _is_listed(host, exceptions):
        return None
    return Proxy(found[1], variable, target)
