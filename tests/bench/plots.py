#!/usr/bin/env python3
"""Draws the plots of measurements, as SVG (python3-matplotlib).

    plots.py curves RECORD.json... --out FOLDER
    plots.py entities RECORD.jsonl --out FILE.svg
    plots.py stage-one LABEL=TABLE... --out FILE.svg [--peer LABEL=SECONDS:DB[,SECONDS:DB...]]...

curves: FOLDER/psnr.svg and FOLDER/miou.svg, error against time, one line a record of
`pepeseg-benchmark curves`. entities: the IoU of each entity of each scene, from the record of
`pepeseg-benchmark suite`. stage-one: PSNR against the seconds of stage one, a curve for each seed,
from tables of `pepeseg_curve_bench --scores N`; --peer adds points that were measured elsewhere.
"""

import argparse
import itertools
import os

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # pylint: disable=wrong-import-position

import measured  # pylint: disable=wrong-import-position
import report  # pylint: disable=wrong-import-position

MARKERS = {"preview": "v", "standard": "s", "best": "*"}
# Text stays text, and the same records give the same bytes.
plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "pepeseg", "font.size": 9})
COLORS = plt.rcParams["axes.prop_cycle"].by_key()["color"]


def color_of(number):
    return COLORS[number % len(COLORS)]


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def save_against_time(figure, axes, xlabel, ylabel, path):
    axes.set_xscale("log")
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.grid(True, which="both", linewidth=0.3)
    axes.legend(fontsize=7)
    save(figure, path)


def points(record, score):
    """Returns (seconds, mean, least, most, name) of each name that has the score, by time."""
    found = []
    for name, runs in report.by_name(record).items():
        values = [value for value in map(score, runs) if value is not None]
        if not values:
            continue
        seconds = measured.mean([report.train_seconds(run, "core_seconds") for run in runs])
        if record["device"].startswith("cuda"):
            seconds = measured.mean([report.train_seconds(run) for run in runs])
        found.append((seconds, measured.mean(values), min(values), max(values), name))
    return sorted(found)


def draw_curve(axes, label, curve, color, dashes="-"):
    seconds = [point[0] for point in curve]
    means = [point[1] for point in curve]
    below = [point[1] - point[2] for point in curve]
    above = [point[3] - point[1] for point in curve]
    axes.errorbar(seconds, means, yerr=[below, above], color=color, linestyle=dashes, marker=".",
                  capsize=2, linewidth=1, label=label)
    for second, value, _, _, name in curve:
        if name in MARKERS:
            axes.plot(second, value, MARKERS[name], color=color, markersize=8)
            axes.annotate(name, (second, value), textcoords="offset points", xytext=(4, -11),
                          fontsize=7, color=color)


def draw_curves(records, out):
    xlabel = "training, seconds (CPU: of all cores together)"
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, record in enumerate(records):
        curve = points(record, lambda run: run["psnr"])
        draw_curve(axes, report.series_name(record), curve, color_of(number))
    save_against_time(figure, axes, xlabel, "PSNR of held-out views, dB",
                      os.path.join(out, "psnr.svg"))
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, record in enumerate(records):
        for style, level in zip(("-", "--", ":"), report.levels_of(record)):
            curve = points(record, lambda run, level=level: 100 * run["levels"][level]["miou"]
                           if level in run["levels"] else None)
            draw_curve(axes, f"{report.series_name(record)}: {level}", curve, color_of(number),
                       style)
    save_against_time(figure, axes, xlabel, "mIoU of one click, %", os.path.join(out, "miou.svg"))


def draw_entities(runs, path):
    """Draws a panel a scene, with a bar a series for each entity: the mean over seeds, with a
    whisker of one standard deviation."""
    choice, series, panels = report.entity_panels(runs)
    figure, all_axes = plt.subplots(
        len(panels), squeeze=False, gridspec_kw={"height_ratios": [len(rows) + 2 for _, rows in panels]},
        figsize=(7.4, 1.5 + sum(0.6 + 0.2 * len(series) * len(rows) for _, rows in panels)))
    height = 0.8 / len(series)
    for axes, (scene, rows) in zip(all_axes[:, 0], panels):
        for number, label in enumerate(series):
            bars = [(place, values[number]) for place, (_, values) in enumerate(rows)
                    if values[number]]
            axes.barh([place + (number - (len(series) - 1) / 2) * height for place, _ in bars],
                      [measured.mean(values) for _, values in bars], height, label=label,
                      xerr=[measured.deviation(values) for _, values in bars],
                      color=color_of(number), error_kw={"elinewidth": 1, "capsize": 2})
        axes.set_yticks(range(len(rows)), [name for name, _ in rows])
        axes.invert_yaxis()
        axes.set_xlim(0, 100)
        axes.set_title(scene, loc="left", fontsize=9)
        axes.grid(True, axis="x", linewidth=0.3)
    figure.suptitle(f"{runs[0]['benchmark']}, protocol {runs[0]['protocol']}: IoU, %; scale: {choice}",
                    fontsize=9)
    if len(series) > 1:
        all_axes[0, 0].legend(fontsize=7)
    save(figure, path)


def stage_one_curves(path):
    """Returns {seed: [(seconds, PSNR), ...]} of the rows of a table."""
    with open(path, encoding="utf-8") as table:
        rows, _ = measured.parse_rows(table.read())
    curves = {}
    for row in rows:
        curves.setdefault(row["seed"], []).append((float(row["stage one s"]), float(row["PSNR"])))
    if not curves:
        raise SystemExit(f"{path}: no table of pepeseg_curve_bench")
    return curves


def peer_of(text):
    label, _, words = text.partition("=")
    return label, [tuple(map(float, point.split(":"))) for point in words.split(",")]


def draw_stage_one(tables, peers, path):
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, table in enumerate(tables):
        label, _, file = table.partition("=")
        for curve in stage_one_curves(file).values():
            axes.plot(*zip(*curve), color=color_of(number), marker=".", linewidth=1, label=label)
            label = None  # one entry of the legend for all seeds
    for marker, peer in zip(itertools.cycle("x^sv"), peers):
        label, measured_there = peer_of(peer)
        axes.plot(*zip(*measured_there), color="black", marker=marker, markersize=4, linestyle=":",
                  linewidth=1, label=label)
    save_against_time(figure, axes, "stage one, seconds", "PSNR of held-out views, dB", path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plot", choices=["curves", "entities", "stage-one"])
    parser.add_argument("files", nargs="+", metavar="FILE or LABEL=FILE")
    parser.add_argument("--out", required=True)
    parser.add_argument("--peer", action="append", default=[], metavar="LABEL=SECONDS:DB,...")
    arguments = parser.parse_args()
    if arguments.plot == "curves":
        draw_curves(report.read_records(arguments.files), arguments.out)
    elif arguments.plot == "entities":
        draw_entities(report.read_runs(arguments.files[0]), arguments.out)
    else:
        draw_stage_one(arguments.files, arguments.peer, arguments.out)


if __name__ == "__main__":
    main()
