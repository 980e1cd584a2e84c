#!/usr/bin/env python3
"""Writes measured.inc from logs of stress_numerics_test.

    update_measured.py LOG...    short and full forms, CPU and CUDA; later logs win

A row keeps its value for each form that no log measured.
"""

import pathlib
import re
import sys

COLUMNS = ("cpu short", "cpu full", "cuda short", "cuda full")
TABLE = pathlib.Path(__file__).with_name("measured.inc")


def kind_of(name: str) -> str:
    if name.endswith("IoU"):
        return "kShare"
    if name == "long run, stage two: loss of the last tenth":
        return "kLoss"
    if name.endswith(("PSNR", "held out")) or name.startswith(("photographs,", "priors,", "scene,")):
        return "kDecibels"
    return "kLoss" if name.startswith("masks,") else "kError"


def main() -> None:
    rows: dict[str, dict[str, str]] = {}
    for line in TABLE.read_text().splitlines():
        found = re.match(r'\s*\{"(.*)", k\w+, (.*)\},', line)
        if found:
            rows[found[1]] = dict(zip(COLUMNS, found[2].split(", ")))
    for log in sys.argv[1:]:
        for line in pathlib.Path(log).read_text(errors="replace").splitlines():
            if line.startswith("MEASURED|"):
                _, name, backend, form, value = line.split("|")
                rows.setdefault(name, {})[f"{backend} {form}"] = value
    lines = ["// cpu, cpu in full, cuda, cuda in full. Written by update_measured.py."]
    for name, values in rows.items():
        numbers = ", ".join(values.get(column, "kNone") for column in COLUMNS)
        lines.append(f'    {{"{name}", {kind_of(name)}, {numbers}}},')
    TABLE.write_text("\n".join(lines) + "\n")


main()
