#!/usr/bin/env python3
"""Tests deploy/OPERATIONS.md: each alert has a heading, each link a file, each flag exists.

    operations_test.py SOURCE_ROOT
"""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])
failures = []
text = (root / "deploy/OPERATIONS.md").read_text()
alerts = re.findall(r"^ +- alert: (\w+)$", (root / "deploy/prometheus/alerts.yaml").read_text(), re.M)
headings = dict(re.findall(r"^#### (\w+)\n(.*?)(?=^#|\Z)", text, re.M | re.S))
if len(alerts) < 5:
    failures.append(f"only {alerts} found in alerts.yaml")
for alert in alerts:
    if len(headings.get(alert, "").split()) < 20:
        failures.append(f"{alert} is not explained")
for heading in set(headings) - set(alerts):
    failures.append(f"{heading} is explained, but no alert")

pages = [root / "README.md", *sorted((root / "deploy").rglob("*.md"))]
for page in pages:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
        if not (page.parent / target).exists():
            failures.append(f"{page.relative_to(root)}: no {target}")
# The programs must have the flags that these files name.
flags = "".join(p.read_text() for p in [root / "server/flags.cc", root / "server/keys_command.cc"])
for flag in set(re.findall(r"`pepesegd [^`]*?(--[a-z-]+)", text)) | set(
    re.findall(r"^ +- (--[a-z-]+)=?", (root / "deploy/compose.yaml").read_text(), re.M)
) | set(re.findall(r"^ +- (--[a-z-]+)=?", (root / "deploy/kubernetes/base/server.yaml").read_text(), re.M)):
    # The other two are flags of Prometheus.
    if f'"{flag}"' not in flags and not flag.startswith(("--config", "--storage")):
        failures.append(f"pepesegd has no {flag}")
sys.exit("\n".join(failures) or 0)
