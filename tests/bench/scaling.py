#!/usr/bin/env python3
"""Fits exponents of a training's cost to the rows of pepeseg_scaling_bench.

    scaling.py --programs build/bin --out FOLDER [-- FLAG...]

Runs the bench with FLAGs (--device cuda --seconds 30) and writes FOLDER/scaling.json and
FOLDER/scaling.md: every size, and for each dimension the least-squares exponent over all sizes and
over the upper half of them, where fixed costs weigh less. Each exponent is of cost = c * size^b.
"""

import argparse
import json
import os
import subprocess
import sys

import measured

COSTS = ["set-up core s", "step core ms", "preparation core s", "feature step core ms", "MB"]
CUDA_COSTS = ["set-up s", "step ms", "preparation s", "feature step ms", "MB"]


def fit(rows, dimension, cost):
    """Returns the exponents over all rows of the dimension and over its upper half; None if a cost is
    0."""
    of_it = [row for row in rows if row["dimension"] == dimension]
    sizes = [float(row[dimension]) for row in of_it]
    costs = [float(row[cost]) for row in of_it]
    if len(sizes) < 2 or min(costs) <= 0:
        return None
    upper = min(len(sizes) - 2, len(sizes) // 2)
    return measured.exponent(sizes, costs), measured.exponent(sizes[upper:], costs[upper:])


def exponents(rows, costs):
    dimensions = dict.fromkeys(row["dimension"] for row in rows)
    return {dimension: {cost: fit(rows, dimension, cost) for cost in costs}
            for dimension in dimensions}


def table(record):
    lines = [f"`scaling.py`: {record['machine']}; commit {record['commit']}; flags "
             f"`{' '.join(record['flags'])}`.", "",
             "Exponent over all sizes / over the upper half of them:", ""]
    fitted = []
    for dimension, by_cost in record["exponents"].items():
        sizes = [row[dimension] for row in record["rows"] if row["dimension"] == dimension]
        cells = [dimension, f"{sizes[0]} to {sizes[-1]}"]
        for pair in by_cost.values():
            cells.append("-" if pair is None else f"{pair[0]:.2f} / {pair[1]:.2f}")
        fitted.append(cells)
    costs = list(next(iter(record["exponents"].values())))
    lines += measured.markdown(["dimension", "from to", *costs], fitted)
    heading = list(record["rows"][0])
    return lines + [""] + measured.markdown(heading, [[row[name] for name in heading]
                                                      for row in record["rows"]])


def run_bench(programs, flags):
    """Runs a command, prints its output as it comes, and returns it."""
    command = [os.path.join(programs, "pepeseg_scaling_bench"), *flags]
    lines = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bench:
        for line in bench.stdout:
            print(line, end="", file=sys.stderr, flush=True)
            lines.append(line)
    if bench.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: exit code {bench.returncode}")
    return "".join(lines)


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", default="build/bin")
    parser.add_argument("--out", required=True)
    arguments = parser.parse_args(words[:split])
    flags = words[split + 1:]
    record = {"machine": measured.machine(), "commit": measured.commit(), "flags": flags}
    record["rows"], _ = measured.parse_rows(run_bench(arguments.programs, flags))
    record["exponents"] = exponents(record["rows"], CUDA_COSTS if "cuda" in flags else COSTS)
    os.makedirs(arguments.out, exist_ok=True)
    path = os.path.join(arguments.out, "scaling")
    with open(path + ".json", "w", encoding="utf-8") as file:
        json.dump(record, file, indent=1)
    with open(path + ".md", "w", encoding="utf-8") as file:
        file.write("\n".join(table(record)) + "\n")


if __name__ == "__main__":
    main()
