#!/usr/bin/env python3
"""Measures trainings and first clicks of several scenes at a time against their number.

    deploy/with_server.sh build build/bench tests/bench/concurrent_scenes.py --programs build/bin \\
        --out FOLDER --scenes 1,2,4 DATASET_FOLDER [-- FLAG...]

For each number N uploads the dataset as N scenes, starts all trainings at once and waits for the last
model; then requests the same click from all of them at once. FLAGs go to `pepeseg train`, such as
--preset preview. Writes FOLDER/concurrent.json and FOLDER/concurrent.md with the exponents.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import measured


def pepeseg(programs, *words):
    """Runs a command and returns its standard output. An error contains what the command printed."""
    done = subprocess.run([os.path.join(programs, "pepeseg"), *words], capture_output=True,
                          text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"pepeseg {' '.join(words)}: {done.stderr.strip()}")
    return done.stdout


def first_view(dataset):
    return sorted(os.listdir(os.path.join(dataset, "images")))[0]


def timed(ask, scenes):
    """Returns the wall seconds until `ask`, called for all scenes at once, has answered for each."""
    start = time.monotonic()
    with ThreadPoolExecutor(len(scenes)) as pool:
        list(pool.map(ask, scenes))
    return time.monotonic() - start


def measure(arguments, flags, number):
    scenes = [f"at-once-{number}-{scene}" for scene in range(number)]
    for scene in scenes:
        pepeseg(arguments.programs, "upload", scene, arguments.dataset)
    click = ["--view", first_view(arguments.dataset), "--point", arguments.point,
             "--threshold", "0"]
    row = {"scenes": number}

    def train(scene):
        pepeseg(arguments.programs, "train", scene, *flags)

    def ask(scene):
        pepeseg(arguments.programs, "--json", "segment", scene, *click)

    row["train s"] = timed(train, scenes)
    row["first click s"] = timed(ask, scenes)
    row["next click s"] = timed(ask, scenes)
    return row


def table(record):
    rows = record["rows"]
    heading = list(rows[0])
    lines = [f"`concurrent_scenes.py`: {record['machine']}; commit {record['commit']}; "
             f"{record['dataset']}; flags `{' '.join(record['flags'])}`. A click includes the "
             "start of the client.", ""]
    cells = [[row["scenes"]] + [f"{row[cost]:.2f}" for cost in heading[1:]] for row in rows]
    lines += measured.markdown(heading, cells)
    if len(rows) > 1:
        fits = [measured.exponent([row["scenes"] for row in rows], [row[cost] for row in rows])
                for cost in heading[1:]]
        lines.append("| exponent | " + " | ".join(f"{fit:.2f}" for fit in fits) + " |")
    return lines


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--programs", default="build/bin")
    parser.add_argument("--out", required=True)
    parser.add_argument("--scenes", default="1,2,4")
    parser.add_argument("--point", default="100,80", help="of the click, in the first view")
    arguments = parser.parse_args(words[:split])
    record = {"machine": measured.machine(), "commit": measured.commit(),
              "dataset": os.path.basename(arguments.dataset.rstrip("/")),
              "flags": words[split + 1:], "rows": []}
    os.makedirs(arguments.out, exist_ok=True)
    path = os.path.join(arguments.out, "concurrent")
    for number in map(int, arguments.scenes.split(",")):
        record["rows"].append(measure(arguments, record["flags"], number))
        print(record["rows"][-1], file=sys.stderr, flush=True)
        with open(path + ".json", "w", encoding="utf-8") as file:
            json.dump(record, file, indent=1)
    with open(path + ".md", "w", encoding="utf-8") as file:
        file.write("\n".join(table(record)) + "\n")


if __name__ == "__main__":
    main()
