"""Shared by the scripts of this folder: tables of the programs, spreads, fits, the machine."""

import math
import os
import platform
import subprocess


def parse_rows(text):
    """Returns the rows of a bench program's Markdown table as dicts, and its '# ...' lines."""
    heading, rows, comments = None, [], []
    for line in text.splitlines():
        if line.startswith("#"):
            comments.append(line.lstrip("# "))
        if not line.startswith("|"):
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if set("".join(cells)) <= {"-"}:
            continue
        if heading is None:
            heading = cells
            continue
        if len(cells) != len(heading):
            raise ValueError(f"{len(cells)} cells under {len(heading)} headings: {line}")
        rows.append(dict(zip(heading, cells)))
    return rows, comments


def mean(values):
    return sum(values) / len(values)


def spread(values, decimals):
    """Returns 'mean (least to most)', only the value if there is one, or '-' if there is none."""
    if not values:
        return "-"
    text = f"{mean(values):.{decimals}f}"
    if len(values) == 1:
        return text
    return f"{text} ({min(values):.{decimals}f} to {max(values):.{decimals}f})"


def deviation(values):
    """Returns the standard deviation over the values; 0 of one."""
    if len(values) < 2:
        return 0
    return math.sqrt(sum((value - mean(values)) ** 2 for value in values) / (len(values) - 1))


def exponent(sizes, costs):
    """Returns b of the least-squares line log(cost) = a + b log(size)."""
    if len(sizes) < 2:
        raise ValueError("a slope needs two sizes")
    x = [math.log(size) for size in sizes]
    y = [math.log(cost) for cost in costs]
    x_mean, y_mean = mean(x), mean(y)
    variance = sum((a - x_mean) ** 2 for a in x)
    if variance == 0:
        raise ValueError("all sizes are the same")
    return sum((a - x_mean) * (b - y_mean) for a, b in zip(x, y)) / variance


def markdown(heading, rows):
    """Returns the lines of a Markdown table."""
    lines = ["| " + " | ".join(heading) + " |", "|" + "---|" * len(heading)]
    return lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]


def _first_line(command):
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return (done.stdout.strip().splitlines() or [""])[0]


def _processor():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def machine():
    """Describes the machine: processor, cores, GPU and load."""
    words = [_processor(), f"{os.cpu_count()} cores"]
    gpu = _first_line(["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"])
    if gpu:
        words.append(gpu)
    words.append(f"load {os.getloadavg()[0]:.1f} at the start")
    return ", ".join(words)


def device_of(flags):
    """Returns the device of the flags as a server names it: "cuda ..." or "cpu ..."."""
    words = [word.removeprefix("--device=") for word in flags if word.startswith("--device=")]
    words += [value for flag, value in zip(flags, flags[1:]) if flag == "--device"]
    return words[-1] if words else "cpu"


def commit():
    """Returns the commit of this script's tree, followed by '+' if it has changes; '' outside git."""
    here = os.path.dirname(os.path.abspath(__file__))
    name = _first_line(["git", "-C", here, "rev-parse", "--short", "HEAD"])
    changed = _first_line(["git", "-C", here, "status", "--porcelain", "--untracked-files=no"])
    return name + "+" if name and changed else name
