"""Tests the HTTP proxy of the environment: whom it is used for, and who is blamed."""

import asyncio
import socket
import threading

import pytest

import pepeseg
import pepeseg.aio
from pepeseg.proxy import proxy_of

VARIABLES = ("grpc_proxy", "https_proxy", "http_proxy", "no_grpc_proxy", "no_proxy", "PEPESEG_KEY")
REMOTE = "203.0.113.5:50051"  # of TEST-NET-3, which no machine has


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    for variable in VARIABLES:
        monkeypatch.delenv(variable, raising=False)
    return monkeypatch


class FakeProxy:
    """A proxy on this machine that answers each CONNECT with `answer` and hangs up."""

    def __init__(self, answer):
        self._answer = answer
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.requests = []
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            with connection:
                self.requests.append(connection.recv(4096))
                connection.sendall(self._answer)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


def message_of(target):
    with pepeseg.Client("mine", server=target, patience=0) as client:
        with pytest.raises(pepeseg.UnavailableError) as error:
            client.scenes()
    return str(error.value)


def own_hosts():
    """Returns hosts of this machine; among them the address by which others reach it, if any."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((REMOTE.partition(":")[0], 1))  # sends nothing
            outward = [probe.getsockname()[0]]
        except OSError:
            outward = []
    return ["127.0.0.1", "127.0.0.2", "localhost", "[::1]", *outward]


class TestProxyOf:
    def test_is_the_one_of_the_first_variable(self, environment):
        assert proxy_of(REMOTE) is None
        environment.setenv("http_proxy", "http://me:secret@proxy.lab:3128/")
        assert (proxy_of(REMOTE).address, proxy_of(REMOTE).variable) == (
            "proxy.lab:3128",
            "http_proxy",
        )
        environment.setenv("grpc_proxy", "http://[::1]:8")
        assert proxy_of(REMOTE).address == "[::1]:8"
        environment.setenv("grpc_proxy", "")
        assert proxy_of(REMOTE) is None
        environment.setenv("grpc_proxy", "https://proxy.lab:1")
        assert proxy_of(REMOTE) is None

    @pytest.mark.parametrize(
        "exceptions, target, used",
        [
            ("10.0.0.0/8", "10.200.3.4:1", False),
            ("10.0.0.0/8", "11.0.0.1:1", True),
            ("a.org, 192.168.16.0/20", "192.168.31.255:1", False),
            ("192.168.16.0/20", "192.168.32.0:1", True),
            ("2001:db8::/33", "[2001:db8:7fff::1]:1", False),
            ("2001:db8::/33", "[2001:db8:8000::1]:1", True),
            ("10.0.0.0/40,10.0.0.0/x,/8", "10.0.0.1:1", True),
            (".lab.ORG", "gpu.lab.org:1", False),
            (".lab.org", "gpu.lab.com:1", True),
            ("*", REMOTE, False),
            (",,", REMOTE, True),
        ],
    )
    def test_is_not_for_hosts_of_no_proxy(self, environment, exceptions, target, used):
        environment.setenv("http_proxy", "http://proxy.lab:3128")
        environment.setenv("no_proxy", exceptions)
        assert (proxy_of(target) is not None) == used
        environment.setenv("no_grpc_proxy", "other.org")
        assert proxy_of(target) is not None

    def test_is_never_for_this_machine(self, environment):
        with FakeProxy(b"HTTP/1.1 403 Forbidden\r\n\r\n") as proxy:
            environment.setenv("http_proxy", f"http://{proxy.address}")
            assert proxy_of(f"{socket.gethostname()}:50051") is None
            assert proxy_of("unix:/run/pepeseg") is None
            for host in own_hosts():
                assert proxy_of(f"dns:///{host}:1") is None
                assert "proxy" not in message_of(f"{host}:1")
            assert proxy.requests == []
            message_of(REMOTE)
            assert proxy.requests, "other machines are reached through the proxy"


class TestMessages:
    @pytest.mark.parametrize("status", [403, 407, 502])
    @pytest.mark.parametrize("variable", ["http_proxy", "https_proxy", "grpc_proxy"])
    def test_name_the_proxy_that_refuses(self, environment, status, variable):
        with FakeProxy(f"HTTP/1.1 {status} No\r\n\r\n".encode()) as proxy:
            environment.setenv(variable, f"http://me:secret@{proxy.address}")
            assert message_of(REMOTE) == (
                f"the proxy {proxy.address}, which {variable} names, refused the connection to "
                f"{REMOTE} with HTTP {status}; to connect without it, add 203.0.113.5 to no_proxy"
            )

    def test_name_the_proxy_in_asyncio_calls(self, environment):
        async def ask():
            async with pepeseg.aio.Client("mine", server=REMOTE, patience=0) as client:
                await client.scenes()

        with FakeProxy(b"HTTP/1.1 403 Forbidden\r\n\r\n") as proxy:
            environment.setenv("http_proxy", f"http://{proxy.address}")
            with pytest.raises(pepeseg.UnavailableError, match="which http_proxy names, refused"):
                asyncio.run(ask())

    def test_name_the_proxy_of_an_upload(self, environment, tmp_path):
        (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff\xd9")
        environment.setenv("http_proxy", "http://127.0.0.1:1")
        with pepeseg.Client("mine", server=REMOTE, patience=0) as client:
            with pytest.raises(pepeseg.UnavailableError, match="which http_proxy names, cannot be"):
                client.upload(tmp_path)

    def test_name_the_proxy_that_cannot_be_reached(self, environment):
        environment.setenv("http_proxy", "http://127.0.0.1:1")
        message = message_of("example.org:50051")
        assert "the proxy 127.0.0.1:1, which http_proxy names, cannot be reached: " in message
        assert "example.org to no_proxy" in message and "pepesegd" not in message
        environment.setenv("http_proxy", "http://nosuch.invalid:3128")
        assert "its name could not be resolved" in message_of(REMOTE)

    def test_name_the_proxy_that_speaks_no_http(self, environment):
        with FakeProxy(b"junk\r\n\r\n") as proxy:
            environment.setenv("http_proxy", f"http://{proxy.address}")
            assert f"the proxy {proxy.address}, which http_proxy names, did not" in message_of(REMOTE)
