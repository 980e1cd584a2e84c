"""Fixtures: a server of the build, and the shelf with a model of few steps at a quarter of its size."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import signal
import subprocess
import time

import pytest

import pepeseg

ROOT = Path(__file__).parents[4]
SHELF = ROOT / "tests" / "data" / "apc_shelf"
PROGRAMS = Path(os.environ["PEPESEG_PROGRAMS"])
SMALL = {"steps": 300, "feature_steps": 150, "image_scale": 0.25}


class Pepesegd:
    """A server on its own port, with its data in a folder."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        self._options = options
        self.address = "127.0.0.1:0"
        self.start()

    def start(self) -> None:
        """Starts the server; a second time on the same port."""
        port_file = self.folder / "port"
        port_file.unlink(missing_ok=True)
        with open(self.folder / "log", "ab") as log:
            self._process = subprocess.Popen(
                [
                    PROGRAMS / "pepesegd",
                    *("--listen", self.address),
                    *("--data", self.folder / "data"),
                    *("--sam", "off"),
                    *("--port-file", port_file),
                    *self._options,
                ],
                stdout=log,
                stderr=log,
            )
        end = time.monotonic() + 30
        while not (port_file.exists() and port_file.read_text().strip()):
            if self._process.poll() is not None or time.monotonic() > end:
                raise RuntimeError((self.folder / "log").read_text())
            time.sleep(0.02)
        self.address = f"127.0.0.1:{port_file.read_text().strip()}"

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def stop(self) -> None:
        self._process.send_signal(signal.SIGTERM)
        try:
            self._process.wait(30)
        except subprocess.TimeoutExpired:
            self.kill()


@pytest.fixture(autouse=True)
def no_login_of_mine(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SERVER", "KEY", "CA", "CERTIFICATE", "CERTIFICATE_KEY"):
        monkeypatch.delenv(f"PEPESEG_{name}", raising=False)


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pepesegd]:
    running = Pepesegd(tmp_path_factory.mktemp("server"))
    yield running
    running.stop()


@pytest.fixture(scope="session")
def trained(server: Pepesegd) -> str:
    """Returns the id of the scene."""
    with pepeseg.Client("shelf", server=server.address) as client:
        client.upload(SHELF)
        client.train(**SMALL, options={"features.num_pixels": 400})
    return "shelf"


@pytest.fixture
def client(server: Pepesegd, trained: str) -> Iterator[pepeseg.Client]:
    with pepeseg.Client(trained, server=server.address) as connected:
        yield connected
