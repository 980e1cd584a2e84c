#!/usr/bin/env bash
# gRPC's C core reads http_proxy and no_proxy in a way of its own.
#
# grpcio 1.51.1, as packaged by Debian 12; the C++ library behind it is the same. One would expect what
# curl and Python's requests do. Seen, with a proxy on 127.0.0.1 that answers 403 and logs CONNECT:
#   - no_proxy=* does not turn the proxy off. Ranges (203.0.113.0/24) and HOST:PORT are not understood.
#   - an entry of no_proxy matches the end of a name without regard to dots: ample.invalid keeps
#     notexample.invalid from the proxy.
#   - calls to 127.0.0.1, localhost and ::1 go to the proxy.
#   - HTTP_PROXY and all_proxy are not read; http_proxy, https_proxy and grpc_proxy are.
#   - http_proxy=http://127.0.0.1 without a port dials port 0, not 80.
#   - the status of a refusal has the proxy's address, but neither its name nor that of the variable.
#
# Needs Debian 12's apt and python3, and about 5 MB. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq python3-grpcio=1.51.1-3+b1 libgrpc29=1.51.1-3+b1 libabsl20220623 libre2-9 libc-ares2 \
  python3-six
for package in *.deb; do dpkg-deb -x "$package" .; done
libraries=$(dirname "$(find "$folder/usr/lib" -name 'libgrpc.so.29')")

cat > behaviour.py <<'SOURCE'
import os
import socket
import threading

import grpc

VARIABLES = ("grpc_proxy", "https_proxy", "http_proxy", "HTTP_PROXY", "all_proxy", "no_grpc_proxy",
             "no_proxy", "NO_PROXY")
asked = []


def refuse(listener):
    while True:
        connection, _ = listener.accept()
        asked.append(connection.recv(4096).split(b" ")[1].decode())
        connection.sendall(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\n\r\n")
        connection.close()


def call(target, **environment):
    """Returns whether the proxy was asked for the target, and the details of the error."""
    for name in VARIABLES:
        os.environ.pop(name, None)
    os.environ.update(environment)
    asked.clear()
    with grpc.insecure_channel(target) as channel:
        try:
            channel.unary_unary("/a.Service/Method")(b"", timeout=3)
        except grpc.RpcError as error:
            return bool(asked), error.details()
    return bool(asked), ""


listener = socket.create_server(("127.0.0.1", 0))
threading.Thread(target=refuse, args=(listener,), daemon=True).start()
proxy = "http://localhost:%d" % listener.getsockname()[1]
far, name = "203.0.113.5:50051", "notexample.invalid:50051"
print("grpcio", grpc.__version__)
expected = [
    (True, far, dict(http_proxy=proxy)),
    (True, far, dict(https_proxy=proxy)),
    (True, far, dict(grpc_proxy=proxy)),
    (False, far, dict(HTTP_PROXY=proxy)),
    (False, far, dict(all_proxy=proxy)),
    (True, far, dict(http_proxy=proxy, no_proxy="*")),
    (True, far, dict(http_proxy=proxy, no_proxy="203.0.113.0/24")),
    (True, far, dict(http_proxy=proxy, no_proxy="203.0.113.5:50051")),
    (False, far, dict(http_proxy=proxy, no_proxy="203.0.113.5")),
    (True, name, dict(http_proxy=proxy, no_proxy="other.invalid")),
    (False, name, dict(http_proxy=proxy, no_proxy="ample.invalid")),
    (True, "127.0.0.1:1", dict(http_proxy=proxy)),
    (True, "localhost:1", dict(http_proxy=proxy)),
    (True, "[::1]:1", dict(http_proxy=proxy)),
]
changed = 0
for through_proxy, target, environment in expected:
    seen, details = call(target, **environment)
    text = " ".join("%s=%s" % item for item in environment.items()).replace(proxy, "PROXY")
    print("%-28s %-50s %s" % (target, text, "proxy" if seen else "no proxy"))
    changed += seen != through_proxy
_, details = call(far, http_proxy=proxy)
print("refused:", details)
changed += "HTTP proxy returned response code 403" not in details or "localhost" in details
_, details = call(far, http_proxy="http://127.0.0.1")
print("no port:", details)
changed += "127.0.0.1:0:" not in details
raise SystemExit(1 if changed else 0)
SOURCE
LD_LIBRARY_PATH=$libraries PYTHONPATH=$folder/usr/lib/python3/dist-packages /usr/bin/python3 behaviour.py ||
  { echo 'the behaviour has changed'; exit 1; }
echo 'as described'
