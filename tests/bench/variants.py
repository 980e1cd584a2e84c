#!/usr/bin/env python3
"""Compares variants of a training on capture packs with the first one: scores and time.

    variants.py ablation|robustness|skips --programs build/bin --out FOLDER PACK... [-- FLAG...]

ablation: stage two without terms of its loss, on one geometry that FOLDER keeps; then the depth loss
and the refinement of stage one.
robustness: fewer views and masks, bent masks, turned views, depth upside down (capture_faults.h).
skips: each part that a training skips if the scene does not need it is never skipped, one at a time
and all together. A pack with ground truth is trained and scored by pepeseg_segment_bench, a pack
without by pepeseg_curve_bench (stage one only). FLAGs go to every run, such as
--device cuda --seeds 3. Writes FOLDER/TABLE.json after every run and FOLDER/TABLE.md at the end.
"""

import argparse
import json
import os
import subprocess
import sys

import measured

# Flags of each variant, and the first stage that they affect. Packs without ground truth have no
# stage two.
STAGE_ONE, STAGE_TWO = "one", "two"
NO_CENTROIDS = ["-o", "features.centroid_weight_upper=0", "-o", "features.centroid_weight_lower=0"]
NO_PERCEPTION = ["-o", "features.perception_weight=0"]
VARIANTS = {
    "ablation": [
        ("all by default", STAGE_TWO, []),
        ("masks only", STAGE_TWO, [*NO_PERCEPTION, *NO_CENTROIDS,
                                   "-o", "features.num_background_pixels=0"]),
        ("masks and background", STAGE_TWO, [*NO_PERCEPTION, *NO_CENTROIDS]),
        ("no centroids", STAGE_TWO, NO_CENTROIDS),
        ("perception without other views", STAGE_TWO,
         ["-o", "features.perception_cross_view=false"]),
        ("masks not completed", STAGE_TWO, ["-o", "features.complete_masks=false"]),
        ("each mask its own scale", STAGE_TWO, ["-o", "features.share_scales=false"]),
        ("depth and refinement in stage one", STAGE_ONE,
         ["-o", "reconstruct.depth_weight=-1", "-o", "reconstruct.refine_keep=shrink"]),
    ],
    "robustness": [
        ("as it is", STAGE_ONE, []),
        ("1/4 of the views", STAGE_ONE, ["--keep-views", "0.25"]),
        ("30 % fewer masks", STAGE_TWO, ["--keep-masks", "0.7"]),
        ("masks bent by {mask_noise} px", STAGE_TWO, ["--mask-noise", "{mask_noise}"]),
        ("views turned by {pose_noise} px", STAGE_ONE, ["--pose-noise", "{pose_noise}"]),
        ("depth upside down", STAGE_ONE, ["--invert-depth"]),
        ("no depth", STAGE_ONE, ["--no-depth"]),
        ("depth loss", STAGE_ONE, ["-o", "reconstruct.depth_weight=-1"]),
        ("depth loss, depth upside down", STAGE_ONE, ["--invert-depth", "-o",
                                                      "reconstruct.depth_weight=-1"]),
    ],
    "skips": [
        ("all skips", STAGE_ONE, []),
        ("all steps of stage one", STAGE_ONE, ["-o", "reconstruct.min_loss_fall=0"]),
        ("all bands", STAGE_ONE, ["-o", "reconstruct.min_band_gain=0"]),
        ("all steps of stage two", STAGE_TWO, ["-o", "features.min_loss_fall=0"]),
        ("no skips", STAGE_ONE, ["-o", "reconstruct.min_loss_fall=0",
                                 "-o", "reconstruct.min_band_gain=0",
                                 "-o", "features.min_loss_fall=0"]),
    ],
}

def has_truth(program, pack):
    """Returns whether pepeseg_segment_bench takes the pack: it refuses packs without ground truth."""
    done = subprocess.run([program, pack, "--steps", "0"], capture_output=True, text=True,
                          check=False)
    return "no ground truth" not in done.stderr


def run_bench(command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    return measured.parse_rows(done.stdout)


def last_of_each_seed(rows):
    """Returns the last row of each run of pepeseg_curve_bench."""
    return list({row["seed"]: row for row in rows}.values())


def read_rows(rows, shared_geometry=False):
    """Returns the numbers in the rows of either program; of runs that share their geometry, the
    seconds of stage two alone."""
    numbers = []
    for row in rows:
        read = {"seed": int(row["seed"]), "psnr": float(row["PSNR"]),
                "num_gaussians": int(row["Gaussians"]),
                "core_seconds": 0 if shared_geometry else float(row["stage one core s"]),
                "seconds": 0 if shared_geometry else float(row["stage one s"])}
        if "level" in row:
            read["level"] = row["level"]
            read["miou"] = 100 * float(row["mIoU"])
            read["mbiou"] = 100 * float(row["mBIoU"])
            read["feature_core_seconds"] = float(row["stage two core s"])
            read["feature_seconds"] = float(row["stage two s"])
        numbers.append(read)
    return numbers


def differences(rows, base, key):
    """Returns the differences by seed and level, for those that both have."""
    before = {(row["seed"], row.get("level")): row[key] for row in base if key in row}
    return [row[key] - before[row["seed"], row.get("level")] for row in rows
            if key in row and (row["seed"], row.get("level")) in before]


def total_seconds(row, prefix=""):
    return row[f"{prefix}seconds"] + row.get(f"feature_{prefix}seconds", 0)


def tell(pack, variants, prefix):
    """Returns a pack's table rows: each variant by level, with its difference to the first, by seed."""
    base = variants[0]["rows"]
    lines = []
    for variant in variants:
        for level in dict.fromkeys(row.get("level") for row in variant["rows"]):
            rows = [row for row in variant["rows"] if row.get("level") == level]
            same = [row for row in base if row.get("level") == level]
            seconds = [total_seconds(row, prefix) for row in rows]
            before = measured.mean([total_seconds(row, prefix) for row in same])
            first = variant is variants[0]
            cells = [pack, variant["name"], level or "-",
                     measured.spread([row["psnr"] for row in rows], 2)]
            for key, decimals in (("psnr", 2), ("miou", 1), ("miou", 1), ("mbiou", 1)):
                is_difference = len(cells) in (4, 6)
                values = (differences(rows, same, key) if is_difference else
                          [row[key] for row in rows if key in row])
                cells.append("-" if first and is_difference else
                             f"{measured.mean(values):+.{decimals}f}" if is_difference and values
                             else measured.spread(values, decimals))
            cells.append(measured.spread(seconds, 1))
            cells.append("-" if first else f"{measured.mean(seconds) / before:.2f}")
            lines.append(cells)
    return lines


HEADING = ["scene", "variant", "level", "PSNR", "change", "mIoU", "change", "mBIoU", "s",
           "times the first's"]


def table(record):
    # A GPU runs one process at a time; cores are shared.
    prefix = "" if measured.device_of(record["flags"]) == "cuda" else "core_"
    lines = [f"`variants.py {record['table']}`: {record['machine']}; commit {record['commit']}; "
             f"flags `{' '.join(record['flags'])}`.", "",
             "Mean (least to most) over the seeds; changes are against the first variant, seed by "
             f"seed. s: {'core ' if prefix else ''}seconds of both stages.", ""]
    rows = [row for pack, variants in record["packs"].items()
            for row in tell(pack, variants, prefix)]
    return lines + measured.markdown(HEADING, rows)


def variants_of(name, scene, truth, arguments):
    for title, stage, flags in VARIANTS[name]:
        words = {"mask_noise": arguments.mask_noise, "pose_noise": arguments.pose_noise}
        if not truth and stage == STAGE_TWO:
            continue
        shared = name == "ablation" and stage == STAGE_TWO
        geometry = ["--gaussians", os.path.join(arguments.out, scene + ".ply")] if shared else []
        yield title.format(**words), geometry + [flag.format(**words) for flag in flags]


def measure(arguments):
    record = {"table": arguments.table, "machine": measured.machine(),
              "commit": measured.commit(), "flags": arguments.flags, "packs": {}}
    os.makedirs(arguments.out, exist_ok=True)
    path = os.path.join(arguments.out, arguments.table)
    for pack in arguments.packs:
        scene = os.path.splitext(os.path.basename(pack))[0]
        truth = has_truth(os.path.join(arguments.programs, "pepeseg_segment_bench"), pack)
        program = "pepeseg_segment_bench" if truth else "pepeseg_curve_bench"
        record["packs"][scene] = []
        for title, flags in variants_of(arguments.table, scene, truth, arguments):
            own = arguments.flags if truth else [*arguments.flags, "--scores", "1"]
            rows, comments = run_bench([os.path.join(arguments.programs, program), pack, *own,
                                        *flags])
            rows = read_rows(rows if truth else last_of_each_seed(rows), "--gaussians" in flags)
            print(scene, title, rows, file=sys.stderr, flush=True)
            record["packs"][scene].append({"name": title, "flags": flags, "rows": rows,
                                           "told": comments})
            with open(path + ".json", "w", encoding="utf-8") as file:
                json.dump(record, file, indent=1)
    with open(path + ".md", "w", encoding="utf-8") as file:
        file.write("\n".join(table(record)) + "\n")


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=VARIANTS)
    parser.add_argument("packs", nargs="+")
    parser.add_argument("--programs", default="build/bin")
    parser.add_argument("--out", required=True)
    parser.add_argument("--mask-noise", default="3", help="pixels by which masks are bent")
    parser.add_argument("--pose-noise", default="0.5", help="pixels by which views are turned")
    arguments = parser.parse_args(words[:split])
    arguments.flags = words[split + 1:]
    measure(arguments)


if __name__ == "__main__":
    main()
