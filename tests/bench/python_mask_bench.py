#!/usr/bin/python3
"""Compares the Python client's time for a mask as a NumPy array with the C++ client's.

Starts a server of the build, trains the shelf, and runs both clients alternately. Each process
measures the call and the decoding of its response. Exits with 1 if the ratio exceeds the limit.

    tests/bench/python_mask_bench.py build/bin [--rounds 20] [--repeats 50] [--limit 1.5]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
import os
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [
    str(ROOT / folder) for folder in ("clients/python/pepeseg", "tests/clients/python/pepeseg")
]


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs", type=Path)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=50, help="answers a round and client")
    parser.add_argument("--limit", type=float, default=1.5)
    return parser.parse_args()


def time_python(client, view, repeats, **query):
    """Returns the milliseconds of each response."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        mask = client.segment(view, **query).mask
        times.append((time.perf_counter() - start) * 1e3)
        assert mask.any()
    return times


def time_cpp(program, address, request, repeats):
    done = subprocess.run(
        [program, address, request, str(repeats)], check=True, capture_output=True, text=True
    )
    return [float(line) for line in done.stdout.split()]


def write_request(client, path, view, query):
    """Returns the same request as a message."""
    from pepeseg import prompts
    from pepeseg.v1 import prompt_pb2, segmentation_service_pb2

    request = segmentation_service_pb2.SegmentViewsRequest(
        model=client.place.model,
        prompt=prompts.Prompt(view, points=query["points"]).to_message(),
        granularity=prompts.granularity(query["scale"], None, query["threshold"]),
        mask_encoding=prompt_pb2.MASK_ENCODING_COCO_RLE,
    )
    path.write_bytes(request.SerializeToString())


def enlarged(camera, factor):
    return replace(
        camera,
        width=round(camera.width * factor),
        height=round(camera.height * factor),
        **{name: getattr(camera, name) * factor for name in ("fx", "fy", "cx", "cy")},
    )


def compare(arguments, client, address, view, query):
    """Returns the median milliseconds of the Python and the C++ client, run alternately, and the
    median of the rounds' ratios."""
    program = arguments.programs / "pepeseg_mask_bench"
    with tempfile.TemporaryDirectory() as folder:
        request = Path(folder) / "request"
        write_request(client, request, view, query)
        time_python(client, view, 10, **query)
        python, cpp, ratios = [], [], []
        for _ in range(arguments.rounds):
            ours = time_python(client, view, arguments.repeats, **query)
            theirs = time_cpp(program, address, request, arguments.repeats)
            python += ours
            cpp += theirs
            ratios.append(statistics.median(ours) / statistics.median(theirs))
    return statistics.median(python), statistics.median(cpp), statistics.median(ratios)


def main() -> int:
    arguments = parse_arguments()
    os.environ["PEPESEG_PROGRAMS"] = str(arguments.programs)
    from conftest import SHELF, Pepesegd
    import pepeseg

    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        server = Pepesegd(Path(folder))
        try:
            with pepeseg.Client("shelf", server=server.address) as client:
                client.upload(SHELF)
                client.train(steps=1000, feature_steps=500)
                view = client.views()[0]
                large = enlarged(view.camera, 1.8)
                print("| pixels | Python ms | C++ ms | ratio |\n|---|---|---|---|")
                for name, where, factor in (("640x480", view, 1), ("1152x864", large, 1.8)):
                    click = [[440 * factor, 280 * factor]]
                    query = {"points": click, "scale": 0.3, "threshold": 0.75}
                    python, cpp, ratio = compare(arguments, client, server.address, where, query)
                    print(f"| {name} | {python:.2f} | {cpp:.2f} | {ratio:.2f} |", flush=True)
                    worst = max(worst, ratio)
        finally:
            server.stop()
    return 0 if worst <= arguments.limit else 1


if __name__ == "__main__":
    sys.exit(main())
