#!/usr/bin/env python3
"""Tests that dashboard and alerts name only metrics that a server exposes, and most of those.

    dashboard_test.py FOLDER_OF_PROGRAMS SOURCE_ROOT
"""
import json
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request

NAME = re.compile(r"\bpepeseg_[a-z0-9_]+\b")


def expressions(panels):
    for panel in panels:
        yield from expressions(panel.get("panels", []))
        for target in panel.get("targets", []):
            yield target["expr"]


def exposed(text):
    """Returns the names of samples, including those that a histogram adds to its own name."""
    names = set()
    for name, kind in re.findall(r"^# TYPE (\S+) (\S+)$", text, re.MULTILINE):
        suffixes = ("_bucket", "_sum", "_count") if kind == "histogram" else ("",)
        names.update(name + suffix for suffix in suffixes)
    return names


def scrape(programs):
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder, "log")
        with log.open("w") as errors:
            server = subprocess.Popen(
                [programs / "pepesegd", "--data", folder + "/data", "--listen", "127.0.0.1:0",
                 "--devices", "cpu", "--metrics", "127.0.0.1:0"], stderr=errors)
        try:
            for _ in range(300):
                port = re.search(r"metrics on .*, port (\d+)", log.read_text())
                if port:
                    break
                time.sleep(0.1)
            assert port, "the server does not serve: " + log.read_text()
            with urllib.request.urlopen(f"http://127.0.0.1:{port[1]}/metrics", timeout=30) as answer:
                return answer.read().decode()
        finally:
            server.send_signal(signal.SIGTERM)
            server.wait(30)


def main():
    programs, root = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    names = exposed(scrape(programs))
    dashboard = json.loads((root / "deploy/grafana/pepeseg.json").read_text())
    shown = set()
    for expression in expressions(dashboard["panels"]):
        shown.update(NAME.findall(expression))
    for variable in dashboard["templating"]["list"]:
        shown.update(NAME.findall(variable["query"]))
    alerts = set(NAME.findall((root / "deploy/prometheus/alerts.yaml").read_text()))
    assert len(shown) > 20 and len(alerts) > 5, (shown, alerts)
    unknown = sorted((shown | alerts) - names)
    assert not unknown, f"no server exposes {unknown}"
    # One of a histogram's three names is enough.
    of_family = re.compile("_(bucket|sum|count)$")
    ours = {of_family.sub("", name) for name in names if NAME.fullmatch(name)}
    hidden = sorted(ours - {of_family.sub("", name) for name in shown})
    assert not hidden, f"exposed, but on no panel: {hidden}"
    print(f"{len(shown)} metrics on the dashboard, {len(alerts)} in alerts, {len(ours)} exposed")


main()
