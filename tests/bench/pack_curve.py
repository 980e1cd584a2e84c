#!/usr/bin/env python3
"""Measures error against time on a capture pack: the record of `pepeseg-benchmark curves`, without a server.

    pack_curve.py --programs build/bin --out FOLDER PACK [-- FLAG...]

For machines that lack the service's libraries, such as a bare one with a GPU. Trains the lengths and
the presets with pepeseg_segment_bench (with pepeseg_curve_bench, stage one only, if the pack has no
ground truth) and writes FOLDER/record.json after each. FLAGs go to every run, such as --device
cuda --seeds 3.
"""

import argparse
import json
import os
import sys

import measured
import variants


def plans(arguments):
    for steps in filter(None, arguments.steps.split(",")):
        yield f"{steps} steps", ["--steps", steps], ["--feature-steps", steps]
    for preset in filter(None, arguments.presets.split(",")):
        yield preset, ["--preset", preset], []


def runs_of(name, rows, comments):
    """Converts the rows of either program to runs, one for each seed."""
    runs = {}
    peak = [float(text.split()[2]) for text in comments if text.startswith("at most")]
    for row in rows:
        run = runs.setdefault(row["seed"], {
            "name": name, "seed": int(row["seed"]), "psnr": float(row["PSNR"]),
            "ssim": float(row["SSIM"]), "num_gaussians": int(row["Gaussians"]),
            "seconds": {"reconstruct": float(row["stage one s"])},
            "core_seconds": {"reconstruct": float(row["stage one core s"])},
            "steps": {"reconstruct": int(row["steps"] if "steps" in row else row["step"])},
            "peak_device_bytes": 1e6 * (peak[0] if peak else float(row["MB"])),
            "levels": {}})
        if "level" not in row:
            continue
        run["seconds"]["features"] = float(row["stage two s"])
        run["core_seconds"]["features"] = float(row["stage two core s"])
        run["steps"]["features"] = int(row["feature steps"])
        run["levels"][row["level"]] = {
            "entities": int(row["entities"]), "miou": float(row["mIoU"]),
            "mbiou": float(row["mBIoU"]), "oracle_miou": float(row["oracle mIoU"]),
            "oracle_mbiou": float(row["oracle mBIoU"])}
    return list(runs.values())


def measure(arguments, flags):
    record = {"record": "pack_curve.py",
              "dataset": arguments.scene or os.path.splitext(os.path.basename(arguments.pack))[0],
              "device": measured.device_of(flags), "machine": measured.machine(),
              "commit": measured.commit(), "settings": " ".join(flags), "runs": []}
    os.makedirs(arguments.out, exist_ok=True)
    truth = variants.has_truth(os.path.join(arguments.programs, "pepeseg_segment_bench"),
                               arguments.pack)
    for name, stage_one, stage_two in plans(arguments):
        program, own = (("pepeseg_segment_bench", stage_one + stage_two) if truth else
                        ("pepeseg_curve_bench", [*stage_one, "--scores", "1"]))
        rows, comments = variants.run_bench(
            [os.path.join(arguments.programs, program), arguments.pack, *own, *flags])
        rows = rows if truth else variants.last_of_each_seed(rows)
        record["runs"] += runs_of(name, rows, comments)
        print(record["dataset"], name, record["runs"][-1], file=sys.stderr, flush=True)
        with open(os.path.join(arguments.out, "record.json"), "w", encoding="utf-8") as file:
            json.dump(record, file, indent=1)


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pack")
    parser.add_argument("--programs", default="build/bin")
    parser.add_argument("--out", required=True)
    parser.add_argument("--scene", help="name in the record, as \"desk 160x120\"; the pack's")
    parser.add_argument("--steps", default="500,1000,2000,5000", help="of both stages")
    parser.add_argument("--presets", default="preview,standard,best")
    measure(parser.parse_args(words[:split]), words[split + 1:])


if __name__ == "__main__":
    main()
