"""The plots of report.py: error against time, with spreads and marked presets."""

import os

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt  # pylint: disable=wrong-import-position

import measured  # pylint: disable=wrong-import-position
import report  # pylint: disable=wrong-import-position

MARKERS = {"preview": "v", "standard": "s", "best": "*"}


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


def save(figure, axes, ylabel, path):
    axes.set_xscale("log")
    axes.set_xlabel("training, seconds (CPU: of all cores together)")
    axes.set_ylabel(ylabel)
    axes.grid(True, which="both", linewidth=0.3)
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw(records, out):
    # Text stays text, and the same records give the same bytes.
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "pepeseg", "font.size": 9})
    colors = plt.rcParams["axes.prop_cycle"].by_key()["color"]
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, record in enumerate(records):
        curve = points(record, lambda run: run["psnr"])
        draw_curve(axes, report.series_name(record), curve, colors[number % len(colors)])
    save(figure, axes, "PSNR of held-out views, dB", os.path.join(out, "psnr.svg"))
    figure, axes = plt.subplots(figsize=(6.4, 4))
    for number, record in enumerate(records):
        for style, level in zip(("-", "--", ":"), report.levels_of(record)):
            curve = points(record, lambda run, level=level: 100 * run["levels"][level]["miou"]
                           if level in run["levels"] else None)
            draw_curve(axes, f"{report.series_name(record)}: {level}", curve,
                       colors[number % len(colors)], style)
    save(figure, axes, "mIoU of one click, %", os.path.join(out, "miou.svg"))
