#!/usr/bin/env python3
"""Plots PSNR against the seconds of stage one, from the tables of pepeseg_curve_bench.

    stage_one_plot.py --out FILE.svg LABEL=TABLE... [--peer LABEL=SECONDS:DB[,SECONDS:DB...]]...

TABLE is the output of `pepeseg_curve_bench --scores N`, N over 1. Each seed is a curve. --peer adds
points that were measured elsewhere.
"""

import argparse
import itertools

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # pylint: disable=wrong-import-position


def curves_of(path):
    """Returns {seed: [(seconds, PSNR), ...]} of the rows of a table."""
    curves, columns = {}, None
    with open(path, encoding="utf-8") as table:
        for line in table:
            cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
            if "stage one s" in cells and "PSNR" in cells:
                columns = cells
            elif columns is not None and len(cells) == len(columns) and not line.startswith("|-"):
                row = dict(zip(columns, cells))
                point = (float(row["stage one s"]), float(row["PSNR"]))
                curves.setdefault(row["seed"], []).append(point)
    if not curves:
        raise SystemExit(f"{path}: no table of pepeseg_curve_bench")
    return curves


def peer_of(text):
    label, _, points = text.partition("=")
    return label, [tuple(map(float, point.split(":"))) for point in points.split(",")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", required=True, metavar="FILE.svg")
    parser.add_argument("--peer", action="append", default=[], metavar="LABEL=SECONDS:DB,...")
    parser.add_argument("tables", nargs="+", metavar="LABEL=TABLE")
    arguments = parser.parse_args()
    # Text stays text, and the same tables give the same bytes.
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "pepeseg", "font.size": 9})
    colors = plt.rcParams["axes.prop_cycle"].by_key()["color"]
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, table in enumerate(arguments.tables):
        label, _, path = table.partition("=")
        for curve in curves_of(path).values():
            axes.plot(*zip(*curve), color=colors[number % len(colors)], marker=".", linewidth=1,
                      label=label)
            label = None  # one entry of the legend for all seeds
    for marker, peer in zip(itertools.cycle("x^sv"), arguments.peer):
        label, points = peer_of(peer)
        axes.plot(*zip(*points), color="black", marker=marker, markersize=4, linestyle=":",
                  linewidth=1, label=label)
    axes.set_xscale("log")
    axes.set_xlabel("stage one, seconds")
    axes.set_ylabel("PSNR of held-out views, dB")
    axes.grid(True, which="both", linewidth=0.3)
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(arguments.out, metadata={"Date": None})


if __name__ == "__main__":
    main()
