#!/usr/bin/env python3
"""Makes tables from records of `pepeseg-benchmark curves`.

    report.py --out FOLDER RECORD.json...

Writes FOLDER/curves.md. plots.py draws the same records.
"""

import argparse
import json
import os

import measured

PRESETS = ("preview", "standard", "best", "paper")
# The steps from the request to the first click, in their order.
STAGES = ("upload", "queue", "prepare", "sfm", "priors", "reconstruct", "evaluate", "features",
          "index", "between", "first_click")


def by_name(record):
    """Returns the runs of each name, in the order of the record."""
    names = dict.fromkeys(run["name"] for run in record["runs"])
    return {name: [run for run in record["runs"] if run["name"] == name] for name in names}


def series_name(record):
    return f"{record['dataset']}, {record['device'].split(' (')[0]}"


def train_seconds(run, kind="seconds"):
    """Returns the seconds of the reconstruction and the feature training together."""
    return sum(run[kind].get(stage, 0) for stage in ("reconstruct", "features"))


def levels_of(record):
    return list(dict.fromkeys(level for run in record["runs"] for level in run["levels"]))


def megabytes(runs, key):
    known = [run[key] for run in runs if key in run]
    return f"{1e-6 * measured.mean(known):.1f}" if known else "-"


def level_cell(runs, level):
    iou, boundary = ([100 * run["levels"][level][score] for run in runs]
                     for score in ("miou", "mbiou"))
    return f"{level} {measured.spread(iou, 1)} / {measured.mean(boundary):.1f}"


def curve_rows(record):
    rows = []
    for name, runs in by_name(record).items():
        row = [series_name(record), f"**{name}**" if name in PRESETS else name]
        row.append(measured.spread([train_seconds(run) for run in runs], 1))
        row.append(measured.spread([train_seconds(run, "core_seconds") for run in runs], 1))
        row.append(" + ".join(f"{measured.mean([run['steps'].get(stage, 0) for run in runs]):.0f}"
                              for stage in ("reconstruct", "features")))
        row.append(measured.spread([run["psnr"] for run in runs], 2))
        row.append(measured.spread([run["ssim"] for run in runs], 4))
        row.append("; ".join(level_cell(runs, level) for level in levels_of(record)
                             if level in runs[0]["levels"]) or "-")
        row.append(f"{measured.mean([run['num_gaussians'] for run in runs]):.0f}")
        row += [megabytes(runs, "num_bytes"), megabytes(runs, "peak_device_bytes")]
        rows.append(row)
    return rows


CURVE_HEADING = ["scene, device", "training", "s", "core s", "steps", "PSNR", "SSIM",
                 "mIoU / mBIoU", "Gaussians", "model MB", "device MB"]


def share_rows(record):
    """Returns the shares of the steps in the time, for each preset whose model was clicked on."""
    rows = []
    for name, runs in by_name(record).items():
        runs = [run for run in runs if "request_to_click" in run["seconds"]]
        if name not in PRESETS or not runs:
            continue
        total = measured.mean([run["seconds"]["request_to_click"] for run in runs])
        row = [series_name(record), name, f"{total:.1f}"]
        for stage in STAGES:
            seconds = measured.mean([run["seconds"].get(stage, 0) for run in runs])
            row.append(f"{100 * seconds / total:.1f} %" if seconds else "-")
        row.append(f"{1e3 * measured.mean([run['seconds']['next_click'] for run in runs]):.1f}")
        rows.append(row)
    return rows


SHARE_HEADING = ["scene, device", "training", "request to click, s",
                 *(stage.replace("_", " ") for stage in STAGES), "next click, ms"]


def tables(records):
    lines = ["# Error against time", ""]
    for record in records:
        lines.append(f"- {series_name(record)}: {record['device']}; "
                     f"{record.get('machine', 'machine not recorded')}; "
                     f"commit {record.get('commit', 'not recorded')}; "
                     f"settings {record.get('settings', 'not recorded')}; "
                     f"{max(run['seed'] for run in record['runs'])} seeds")
    lines += ["", "Mean (least to most) over the seeds. s: wall time of both stages together; "
              "core s: of all cores together. PSNR, SSIM: held-out views. mIoU / mBIoU: one click, "
              "scale and threshold chosen on the clicked view, scored on the others. Steps: done, "
              "by stage. Device MB: of the training's, at most (CPU: of its arrays).", ""]
    lines += measured.markdown(CURVE_HEADING, [row for record in records
                                               for row in curve_rows(record)])
    shares = [row for record in records for row in share_rows(record)]
    if shares:
        lines += ["", "## From the request to the first click", "",
                  "Upload to the first answer; shares of that time. The first click loads the "
                  "model; the next one is the same again. `between`: starting the worker, handing "
                  "results over.", ""]
        lines += measured.markdown(SHARE_HEADING, shares)
    return lines


def read_records(paths):
    records = []
    for path in paths:
        with open(path, encoding="utf-8") as file:
            records.append(json.load(file))
    return records


def read_runs(path):
    """Returns the runs in record.jsonl of `pepeseg-benchmark suite` that have the benchmark and the
    protocol of the newest one."""
    with open(path, encoding="utf-8") as file:
        runs = [json.loads(line) for line in file if line.strip()]
    return [run for run in runs
            if all(run[key] == runs[-1][key] for key in ("benchmark", "protocol"))]


# The choices of the scale, the most useful first, with what they used.
CHOICES = {"automatic": "chosen without any truth", "reference": "chosen on the reference view",
           "paper": "chosen on the truth of the scored views"}
MAX_SERIES_WITH_ENTITIES = 4


def _series_of(run, same_options):
    if same_options:
        return run["variant"] or "plain"
    return ", ".join(filter(None, [run["options"], run["variant"]]))


def entity_panels(runs):
    """Returns the choice of the scale, the labels of the series, and (scene, rows) of each scene.

    A row is (entity, values), with the IoU of each seed, percent, for each series: the best first,
    then the mean. Runs of one variant with the same options are a series. All values have the same
    choice, the first of CHOICES that was measured. Of more than 4 series only the means are there.
    """
    for choice in CHOICES:
        if any(level[choice]["known"] for run in runs for level in run["levels"]):
            break
    else:
        raise SystemExit("no run has scores")
    same_options = len({run["options"] for run in runs}) == 1
    series = list(dict.fromkeys(_series_of(run, same_options) for run in runs))
    scenes = {}
    for run in runs:
        number = series.index(_series_of(run, same_options))
        for level in run["levels"]:
            rows = scenes.setdefault(f"{run['scene']} {level['name']}".strip(), {})
            values = [(entity["name"], entity[choice]) for entity in level["entities"]
                      if entity[choice] >= 0 and len(series) <= MAX_SERIES_WITH_ENTITIES]
            if level[choice]["known"]:
                values.append(("", level[choice]["iou"]))
            for name, iou in values:
                rows.setdefault(name, [[] for _ in series])[number].append(100 * iou)

    def rank(row):
        first = next(filter(None, row[1]))
        return (row[0] == "", -measured.mean(first), row[0])
    return CHOICES[choice], series, [
        (scene, [(name or "mean", values) for name, values in sorted(rows.items(), key=rank)])
        for scene, rows in sorted(scenes.items()) if rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("records", nargs="+")
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args()
    os.makedirs(arguments.out, exist_ok=True)
    with open(os.path.join(arguments.out, "curves.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(tables(read_records(arguments.records))) + "\n")


if __name__ == "__main__":
    main()
