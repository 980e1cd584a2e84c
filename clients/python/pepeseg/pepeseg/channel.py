"""The connection to a server: address, TLS, and the key that every call carries."""

from __future__ import annotations

from dataclasses import dataclass
import os
import re
from pathlib import Path
from typing import Any

import grpc

from pepeseg.errors import refused
from pepeseg.proxy import Proxy, proxy_of

DEFAULT_SERVER = "127.0.0.1:50051"
_HTTPS, _HTTP = "https://", "http://"
_OPTIONS = [
    ("grpc.max_receive_message_length", 64 << 20),
    # Reconnects within seconds after a server comes back, not within two minutes.
    ("grpc.initial_reconnect_backoff_ms", 250),
    ("grpc.min_reconnect_backoff_ms", 1000),
    ("grpc.max_reconnect_backoff_ms", 2000),
]


@dataclass(frozen=True)
class Login:
    """How to connect. Fields that are None are taken from the environment.

    Attributes:
        server: "[https://]host:port", "http://host:port" or "unix:path"; else PEPESEG_SERVER,
            else 127.0.0.1:50051.
        key: an API key ("pk_...") or a JWT; else the first line of `key_file`, else PEPESEG_KEY.
        key_file: a file whose first line is the key.
        ca: PEM file of the authorities that may sign the server's certificate; else PEPESEG_CA,
            else those that the system trusts.
        certificate, certificate_key: PEM files of this client; else PEPESEG_CERTIFICATE and
            PEPESEG_CERTIFICATE_KEY.
        tls: encrypt; also implied by https://, `ca` and `certificate`.
    """

    server: str | None = None
    key: str | None = None
    key_file: str | os.PathLike[str] | None = None
    ca: str | os.PathLike[str] | None = None
    certificate: str | os.PathLike[str] | None = None
    certificate_key: str | os.PathLike[str] | None = None
    tls: bool = False


@dataclass(frozen=True)
class Connection:
    """A checked login, from which channels are made."""

    target: str
    credentials: grpc.ChannelCredentials | None
    metadata: tuple[tuple[str, str], ...]
    proxy: Proxy | None  # through which calls go

    def open(self) -> grpc.Channel:
        """Returns a channel for blocking calls. It connects with the first call."""
        return self._open(grpc)

    def open_aio(self) -> Any:
        """Returns a grpc.aio.Channel of the running event loop."""
        from grpc import aio

        return self._open(aio)

    def _open(self, module: Any) -> Any:
        options = list(_OPTIONS)
        if self.proxy is None:
            # gRPC 1.51 would use a proxy for this machine's own addresses, too.
            options.append(("grpc.enable_http_proxy", 0))
        if self.credentials is None:
            return module.insecure_channel(self.target, options=options)
        return module.secure_channel(self.target, self.credentials, options=options)


def is_this_machine(target: str) -> bool:
    """Returns whether "host:port" or "unix:path" is certainly this machine."""
    if target.startswith("unix:"):
        return True
    host = target.rpartition(":")[0]
    return host in ("localhost", "[::1]") or re.fullmatch(r"127\.[0-9.]+", host) is not None


def _read(path: str | os.PathLike[str]) -> bytes:
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise refused(f"{os.fspath(path)}: cannot be read: {error.strerror}") from error


def _find_key(login: Login) -> str:
    """Returns the key, empty if there is none."""
    text, source = os.environ.get("PEPESEG_KEY", ""), "PEPESEG_KEY"
    if login.key is not None:
        text, source = login.key, "key"
    elif login.key_file is not None:
        lines = _read(login.key_file).decode(errors="replace").splitlines()
        text, source = (lines or [""])[0], os.fspath(login.key_file)
    key = text.strip()
    if not key and source == "PEPESEG_KEY":
        return ""
    # A key that cannot be a header value would fail each call with an error that names nothing.
    is_key = re.fullmatch(r"pk_[!-~]*", key, re.ASCII)
    is_token = re.fullmatch(r"[\w-]+(\.[\w-]+){2}", key, re.ASCII)
    if not is_key and not is_token:
        raise refused(
            f"{source}: holds no key, which is a line that begins with pk_, and no token (JWT), "
            "which is three parts with '.' between them"
        )
    return key


def _tls_credentials(
    ca: str | os.PathLike[str] | None,
    certificate: str | os.PathLike[str] | None,
    certificate_key: str | os.PathLike[str] | None,
) -> grpc.ChannelCredentials:
    if (certificate is None) != (certificate_key is None):
        raise refused("certificate and certificate_key are given together or not at all")
    return grpc.ssl_channel_credentials(
        root_certificates=None if ca is None else _read(ca),
        private_key=None if certificate_key is None else _read(certificate_key),
        certificate_chain=None if certificate is None else _read(certificate),
    )


def look_through(login: Login) -> Connection:
    """Checks a login, and fills it from the environment.

    Raises:
        InvalidArgumentError: a file cannot be read, the key is malformed or would go to another
            machine unencrypted, or http:// comes with what asks for TLS.
    """
    server = login.server or os.environ.get("PEPESEG_SERVER") or DEFAULT_SERVER
    ca = login.ca or os.environ.get("PEPESEG_CA") or None
    certificate = login.certificate or os.environ.get("PEPESEG_CERTIFICATE") or None
    certificate_key = login.certificate_key or os.environ.get("PEPESEG_CERTIFICATE_KEY") or None
    tls = login.tls or server.startswith(_HTTPS)
    tls = tls or not (ca is None and certificate is None and certificate_key is None)
    if tls and server.startswith(_HTTP):
        raise refused(f"{server} is not encrypted, but tls or a certificate asks for TLS")
    target = server.removeprefix(_HTTPS).removeprefix(_HTTP)
    key = _find_key(login)
    if key and not tls and not is_this_machine(target):
        raise refused(
            f"the key is not sent to {target}: the connection is not encrypted, and whoever is on "
            "the way could read and use it; speak to the server over TLS, with tls=True or ca=FILE"
        )
    credentials = _tls_credentials(ca, certificate, certificate_key) if tls else None
    metadata = (("authorization", f"Bearer {key}"),) if key else ()
    return Connection(target, credentials, metadata, proxy_of(target))
