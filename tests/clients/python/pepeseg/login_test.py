"""Tests the connection: keys, TLS, patience."""

import os
import re
import subprocess
import threading
import time

import grpc
import pytest

import pepeseg
from conftest import PROGRAMS, ROOT, Pepesegd
from pepeseg import errors
from pepeseg.channel import Login, is_this_machine, look_through
from pepeseg.errors import from_rpc


class TestLogin:
    @pytest.mark.parametrize(
        "target", ["localhost:1", "127.0.0.1:1", "127.8.9.1:1", "[::1]:1", "unix:/run/pepeseg"]
    )
    def test_loopback_is_this_machine(self, target):
        assert is_this_machine(target)

    @pytest.mark.parametrize("target", ["10.0.0.1:1", "127.evil.org:1", "localhost.org:1", "a:1"])
    def test_names_that_resemble_loopback_are_other_machines(self, target):
        assert not is_this_machine(target)

    def test_a_key_never_goes_to_another_machine_unencrypted(self):
        with pytest.raises(pepeseg.InvalidArgumentError, match="not encrypted"):
            pepeseg.Client("shelf", server="10.0.0.1:50051", key="pk_1")
        assert look_through(Login("https://10.0.0.1:50051", "pk_1")).credentials is not None
        assert look_through(Login("127.0.0.1:50051", "pk_1")).metadata == (
            ("authorization", "Bearer pk_1"),
        )

    def test_an_address_may_begin_as_in_a_browser(self):
        assert look_through(Login("http://127.0.0.1:7")).target == "127.0.0.1:7"
        with pytest.raises(pepeseg.InvalidArgumentError, match="not encrypted"):
            look_through(Login("http://10.0.0.1:7", "pk_1"))
        with pytest.raises(pepeseg.InvalidArgumentError, match="asks for TLS"):
            look_through(Login("http://127.0.0.1:7", tls=True))

    def test_the_environment_replaces_what_is_not_given(self, monkeypatch, tmp_path):
        monkeypatch.setenv("PEPESEG_SERVER", "localhost:7")
        monkeypatch.setenv("PEPESEG_KEY", "aa.bb.cc")
        found = look_through(Login())
        assert found.target == "localhost:7"
        assert found.metadata[0][1] == "Bearer aa.bb.cc"
        (tmp_path / "key").write_text("pk_2\nmore")
        assert look_through(Login(key_file=tmp_path / "key")).metadata[0][1] == "Bearer pk_2"
        with pytest.raises(pepeseg.InvalidArgumentError, match="cannot be read"):
            look_through(Login(key_file=tmp_path / "none"))

    @pytest.mark.parametrize("key", ["", "secret", "pk_a b", "a.b", "pk_\u00e9", "..", "a..b"])
    def test_malformed_keys_are_refused(self, key):
        with pytest.raises(pepeseg.InvalidArgumentError, match="holds no key"):
            look_through(Login(key=key))

    def test_a_certificate_goes_with_its_key(self, tmp_path):
        with pytest.raises(pepeseg.InvalidArgumentError, match="together"):
            look_through(Login(certificate=tmp_path / "a.pem"))


def create_key(folder, *scopes):
    answer = subprocess.run(
        [
            *(PROGRAMS / "pepesegd", "keys", "create", "--data", folder / "data"),
            *("--project", "lab", "--scopes", ",".join(scopes)),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    return re.search(r"pk_\S+", answer.stdout).group()


def make_certificates(folder):
    script = ROOT / "deploy" / "certificates.sh"
    subprocess.run([script, folder], capture_output=True, check=True)
    return folder


class TestKeys:
    def test_each_refusal_has_its_exception(self, tmp_path):
        running = Pepesegd(tmp_path, "--require-keys")
        try:
            reads = create_key(tmp_path, "read")
            writes = create_key(tmp_path, "read", "write")
            with pepeseg.Client("mine", server=running.address, key=writes) as client:
                client.create_scene()
                assert [scene.id for scene in client.scenes()] == ["mine"]
                with pytest.raises(pepeseg.PermissionDeniedError):
                    client.of("other").views()
            with pepeseg.Client("mine", server=running.address, key=reads) as client:
                with pytest.raises(pepeseg.PermissionDeniedError) as denied:
                    client.delete_scene()
                assert denied.value.reason == "MISSING_SCOPE" and denied.value.limit
            with pepeseg.Client("mine", server=running.address) as client:
                with pytest.raises(pepeseg.UnauthenticatedError) as unknown:
                    client.scenes()
                assert unknown.value.reason == "NO_KEY"
        finally:
            running.stop()


class TestTls:
    def test_the_server_and_the_client_show_certificates(self, tmp_path):
        made = make_certificates(tmp_path / "pki")
        running = Pepesegd(
            tmp_path,
            *("--tls-certificate", made / "server.pem", "--tls-key", made / "server.key"),
            *("--tls-client-ca", made / "ca.pem"),
        )
        running.address = running.address.replace("127.0.0.1", "localhost")
        mine = {"certificate": made / "operator.pem", "certificate_key": made / "operator.key"}
        try:
            with pepeseg.Client(
                "mine", server=f"https://{running.address}", ca=made / "ca.pem", **mine
            ) as client:
                assert client.scenes() == []
            for wrong in ({"ca": made / "ca.pem"}, {"tls": True}, {}):
                with pepeseg.Client("mine", server=running.address, patience=0, **wrong) as client:
                    with pytest.raises(pepeseg.UnavailableError):
                        client.scenes()
        finally:
            running.stop()


class TestPatience:
    def test_waits_for_a_server_that_comes_back(self, tmp_path):
        running = Pepesegd(tmp_path)
        try:
            with pepeseg.Client("mine", server=running.address, patience=60) as client:
                client.create_scene()
                running.kill()
                threading.Timer(0.3, running.start).start()
                assert [scene.id for scene in client.scenes()] == ["mine"]
        finally:
            running.stop()

    def test_raises_unavailable_when_patience_ends(self):
        with pepeseg.Client("mine", server="127.0.0.1:1", patience=1) as client:
            start = time.monotonic()
            with pytest.raises(pepeseg.UnavailableError):
                client.scenes()
            assert 0.2 < time.monotonic() - start < 10


class TestStartAdvice:
    @pytest.mark.parametrize("address", ["127.0.0.1:1", "unix:/tmp/no-such-pepesegd"])
    def test_the_suggested_command_starts_a_server(self, address):
        with pepeseg.Client("mine", server=address, patience=0) as client:
            with pytest.raises(pepeseg.UnavailableError) as error:
                client.scenes()
        found = re.search(r"`(\S+) --listen (\S+)`", str(error.value))
        assert found, error.value
        assert os.access(found[1], os.X_OK)
        assert found[2] == address

    def test_suggests_nothing_for_another_machine(self):
        message = "failed to connect to all addresses; last error: ipv4:192.0.2.1:50051: refused"
        assert errors.start_advice(message) == ""


class Refusal(grpc.RpcError):
    def __init__(self, code, message, trailers=()):
        self.code, self.details = lambda: code, lambda: message
        self.trailing_metadata = lambda: trailers


class TestErrors:
    def test_http_statuses_of_proxies_become_grpc_codes(self):
        for status, kind in ((401, pepeseg.UnauthenticatedError), (503, pepeseg.UnavailableError)):
            message = f"Received http2 header with status: {status}"
            error = from_rpc(Refusal(grpc.StatusCode.UNKNOWN, message))
            assert isinstance(error, kind) and str(status) in error.message

    def test_damaged_details_are_ignored(self):
        trailers = (("grpc-status-details-bin", b"\xff\xff\xff"),)
        error = from_rpc(Refusal(grpc.StatusCode.NOT_FOUND, "", trailers))
        assert isinstance(error, LookupError) and error.reason == ""
        assert str(error) == "NOT_FOUND"
