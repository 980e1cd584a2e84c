#!/usr/bin/env python3
"""Tests the scripts that make tables from measurements; needs no matplotlib."""

import argparse
import math
import os
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
# pylint: disable=wrong-import-position
import measured
import pack_curve
import report
import scaling
import variants

TABLE = """Fixed scales: mIoU at the threshold 0.75.

| run | seed | level | PSNR |
|---|---|---|---|
| run | 1 | part | 30.125 |
# 1 part: a comment
| run | 2 | part | 30.500 |
"""


def run(name, seed, psnr, iou, seconds=10.0):
    return {"name": name, "seed": seed, "psnr": psnr, "ssim": 0.9, "num_gaussians": 1000,
            "num_bytes": 2e6, "peak_device_bytes": 3e8,
            "steps": {"reconstruct": 70, "features": 30},
            "seconds": {"upload": 1, "queue": 0, "prepare": 1, "reconstruct": seconds - 4,
                        "features": 4, "between": 1, "first_click": 1,
                        "request_to_click": seconds + 4, "next_click": 0.01},
            "core_seconds": {"reconstruct": 2 * seconds - 8, "features": 8},
            "levels": {"part": {"miou": iou, "mbiou": iou - 0.1}}}


def record():
    return {"dataset": "desk", "device": "cpu (2 threads, AVX3)", "machine": "two cores",
            "commit": "abc", "runs": [run("100 steps", 1, 20, 0.5), run("100 steps", 2, 22, 0.7),
                                      run("preview", 1, 25, 0.8, 20.0)]}


class Measured(unittest.TestCase):
    def test_reads_rows_by_heading_and_comments(self):
        rows, comments = measured.parse_rows(TABLE)
        self.assertEqual([row["PSNR"] for row in rows], ["30.125", "30.500"])
        self.assertEqual(comments, ["1 part: a comment"])

    def test_refuses_a_row_that_does_not_fit(self):
        with self.assertRaises(ValueError):
            measured.parse_rows("| a | b |\n|---|---|\n| 1 |\n")

    def test_spread_tells_mean_and_bounds(self):
        self.assertEqual(measured.spread([1, 2, 6], 1), "3.0 (1.0 to 6.0)")
        self.assertEqual(measured.spread([2], 2), "2.00")
        self.assertEqual(measured.spread([], 2), "-")

    def test_tells_the_device_of_the_flags(self):
        self.assertEqual(measured.device_of(["--seeds", "3"]), "cpu")
        self.assertEqual(measured.device_of(["--device", "cuda"]), "cuda")
        self.assertEqual(measured.device_of(["--device=cuda"]), "cuda")

    def test_exponent_of_a_power_is_its_own(self):
        sizes = [1, 2, 4, 8]
        self.assertAlmostEqual(measured.exponent(sizes, [3 * size**1.5 for size in sizes]), 1.5)
        self.assertAlmostEqual(measured.exponent(sizes, [7] * 4), 0)

    def test_exponent_is_the_least_squares_one(self):
        # log2 costs 0, 1, 0 at log2 sizes 0, 1, 2: the slope is 0.
        self.assertAlmostEqual(measured.exponent([1, 2, 4], [1, 2, 1]), 0)
        # 0, 0, 3 at 0, 1, 2: sum((x - 1) y) / 2 = 1.5.
        self.assertAlmostEqual(measured.exponent([1, 2, 4], [1, 1, 8]), 1.5)

    def test_exponent_needs_two_sizes(self):
        for sizes in ([4], [4, 4]):
            with self.assertRaises(ValueError):
                measured.exponent(sizes, [1] * len(sizes))


class Report(unittest.TestCase):
    def test_a_row_a_name_with_its_spread(self):
        rows = report.curve_rows(record())
        self.assertEqual(len(rows), 2)
        self.assertEqual(rows[0][1], "100 steps")
        self.assertIn("21.00 (20.00 to 22.00)", rows[0])
        self.assertIn("part 60.0 (50.0 to 70.0) / 50.0", rows[0])
        self.assertEqual(rows[0][2], "10.0 (10.0 to 10.0)")
        self.assertEqual(rows[0][3], "20.0 (20.0 to 20.0)")
        self.assertEqual(rows[1][1], "**preview**")

    def test_shares_add_up_to_the_whole(self):
        (row,) = report.share_rows(record())
        self.assertEqual(row[:3], ["desk, cpu", "preview", "24.0"])
        shares = [float(cell.split()[0]) for cell in row[3:-1] if cell != "-"]
        self.assertTrue(math.isclose(sum(shares), 100, abs_tol=0.5), shares)

    def test_runs_without_a_click_have_no_shares(self):
        without = record()
        for each in without["runs"]:
            del each["seconds"]["request_to_click"], each["seconds"]["next_click"]
            each["levels"] = {}
        self.assertEqual(report.share_rows(without), [])
        self.assertIn("-", report.curve_rows(without)[0])
        self.assertTrue(report.tables([without]))


def scored_run(scene, seed, entities, options="preset=best", variant=""):
    """A line of record.jsonl. `entities`: IoU of the automatic choice by name; none: unknown."""
    mean = {"known": bool(entities), "iou": measured.mean(list(entities.values()) or [0])}
    return {"benchmark": "lerf-mask", "scene": scene, "variant": variant, "seed": seed,
            "protocol": "prompt", "options": options,
            "levels": [{"name": "", "automatic": mean, "reference": {"known": False},
                        "paper": {"known": True, "iou": 0.9},
                        "entities": [{"name": name, "automatic": iou, "reference": -1, "paper": 1}
                                     for name, iou in (entities or {"cat": -1}).items()]}]}


class Entities(unittest.TestCase):
    def test_the_best_entity_is_first_and_the_mean_last(self):
        choice, series, panels = report.entity_panels(
            [scored_run("ramen", 1, {"egg": 0.25, "spoon": 0, "bowl": 1})])
        self.assertIn("without any truth", choice)
        self.assertEqual(series, ["plain"])
        ((scene, rows),) = panels
        self.assertEqual((scene, [name for name, _ in rows]),
                         ("ramen", ["bowl", "egg", "spoon", "mean"]))
        self.assertEqual(rows[1][1], [[25]])

    def test_seeds_are_values_of_one_bar(self):
        _, _, panels = report.entity_panels(
            [scored_run("ramen", seed, {"egg": iou}) for seed, iou in ((1, 0.6), (2, 0.8), (3, 0.7))])
        values = panels[0][1][0][1][0]
        self.assertAlmostEqual(measured.mean(values), 70)
        self.assertAlmostEqual(measured.deviation(values), 10)
        self.assertEqual(measured.deviation([3]), 0)

    def test_presets_and_variants_are_series(self):
        runs = [scored_run("ramen", 1, {"egg": 0.6}), scored_run("ramen", 1, {"egg": 0.5}, "fast"),
                scored_run("ramen", 1, {"plate": 0.2}, variant="k = 8")]
        _, series, panels = report.entity_panels(runs)
        self.assertEqual(series, ["preset=best", "fast", "preset=best, k = 8"])
        self.assertEqual(panels[0][1][:2], [("egg", [[60], [50], []]), ("plate", [[], [], [20]])])

    def test_many_series_have_their_means_only(self):
        runs = [scored_run("ramen", 1, {"egg": 0.1 * k}, variant=f"k = {k}") for k in range(5)]
        _, _, panels = report.entity_panels(runs)
        self.assertEqual([name for name, _ in panels[0][1]], ["mean"])

    def test_choices_of_the_scale_are_never_mixed(self):
        other = scored_run("sofa", 1, {})
        _, _, panels = report.entity_panels([scored_run("ramen", 1, {"egg": 0.6}), other])
        self.assertEqual([scene for scene, _ in panels], ["ramen"])
        choice, _, panels = report.entity_panels([other])
        self.assertIn("truth of the scored views", choice)
        self.assertEqual(panels, [("sofa", [("cat", [[100]]), ("mean", [[90]])])])


class PackCurve(unittest.TestCase):
    ROW = {"seed": "2", "PSNR": "30.5", "SSIM": "0.9", "Gaussians": "100", "stage one s": "3",
           "stage one core s": "5", "MB": "7"}

    def test_the_levels_of_a_seed_are_one_run(self):
        scores = {"entities": "3", "mIoU": "0.5", "mBIoU": "0.4", "oracle mIoU": "0.6",
                  "oracle mBIoU": "0.5", "stage two s": "1", "stage two core s": "2",
                  "steps": "90", "feature steps": "80"}
        rows = [dict(self.ROW, level=level, **scores) for level in ("part", "object")]
        (run_of_both,) = pack_curve.runs_of("x", rows, ["at most 12 MB of the device"])
        self.assertEqual(list(run_of_both["levels"]), ["part", "object"])
        self.assertEqual(run_of_both["steps"], {"reconstruct": 90, "features": 80})
        self.assertEqual(run_of_both["peak_device_bytes"], 12e6)
        self.assertTrue(report.tables([dict(record(), runs=[run_of_both])]))

    def test_stage_one_alone(self):
        (alone,) = pack_curve.runs_of("x", [dict(self.ROW, step="70")], [])
        self.assertEqual(alone["steps"], {"reconstruct": 70})
        self.assertEqual(alone["levels"], {})


class Scaling(unittest.TestCase):
    def test_fits_all_sizes_and_the_upper_half(self):
        rows = [{"dimension": "views", "views": str(2**k), "MB": str(max(8, 2**k))}
                for k in range(7)]
        rows.append({"dimension": "masks", "masks": "5", "MB": "1"})
        whole, upper = scaling.fit(rows, "views", "MB")
        self.assertLess(whole, 0.8)
        self.assertAlmostEqual(upper, 1)
        self.assertIsNone(scaling.fit(rows, "masks", "MB"))


class Variants(unittest.TestCase):
    def test_ablations_of_stage_two_share_a_geometry(self):
        arguments = argparse.Namespace(out="out", mask_noise="3", pose_noise="0.5")
        flags = dict(variants.variants_of("ablation", "desk", True, arguments))
        self.assertEqual(flags["all by default"], ["--gaussians", "out/desk.ply"])
        self.assertNotIn("--gaussians", flags["depth and refinement in stage one"])
        row = {"seed": "1", "PSNR": "30", "Gaussians": "5", "stage one s": "read",
               "stage one core s": "0"}
        self.assertEqual(variants.read_rows([row], shared_geometry=True)[0]["seconds"], 0)

    BASE = [{"seed": 1, "level": "part", "psnr": 30.0, "miou": 90.0, "mbiou": 80.0, "seconds": 1,
             "core_seconds": 2.0, "feature_seconds": 1, "feature_core_seconds": 2.0},
            {"seed": 2, "level": "part", "psnr": 32.0, "miou": 92.0, "mbiou": 80.0, "seconds": 1,
             "core_seconds": 2.0, "feature_seconds": 1, "feature_core_seconds": 2.0}]

    def test_changes_are_seed_by_seed(self):
        worse = [dict(row, psnr=row["psnr"] - 1, core_seconds=6.0) for row in self.BASE]
        rows = variants.tell("desk", [{"name": "first", "rows": self.BASE},
                                      {"name": "worse", "rows": worse}], "core_")
        self.assertEqual(rows[0][4], "-")
        self.assertEqual(rows[1][:7], ["desk", "worse", "part", "30.00 (29.00 to 31.00)", "-1.00",
                                       "91.0 (90.0 to 92.0)", "+0.0"])
        self.assertEqual(rows[1][-1], "2.00")

    def test_a_gpu_is_compared_by_its_seconds(self):
        slower = [dict(row, seconds=3, core_seconds=9.0) for row in self.BASE]
        told = {"table": "skips", "machine": "one", "commit": "abc", "packs": {
            "desk": [{"name": "first", "rows": self.BASE}, {"name": "slower", "rows": slower}]}}
        on_gpu = variants.table(dict(told, flags=["--device", "cuda"]))
        self.assertIn("| 4.0 (4.0 to 4.0) | 2.00 |", on_gpu[-1])
        on_cores = variants.table(dict(told, flags=[]))
        self.assertIn("| 11.0 (11.0 to 11.0) | 2.75 |", on_cores[-1])

    def test_a_seed_that_the_first_lacks_has_no_change(self):
        self.assertEqual(variants.differences([dict(self.BASE[0], seed=9)], self.BASE, "psnr"), [])

    def test_stage_one_alone_has_no_segments(self):
        rows = [{"seed": 1, "psnr": 30.0, "seconds": 1, "core_seconds": 2.0}]
        (row,) = variants.tell("fern", [{"name": "first", "rows": rows}], "")
        self.assertEqual(row[2:7], ["-", "30.00", "-", "-", "-"])

    def test_the_last_row_of_a_seed_is_its_end(self):
        rows = [{"seed": "1", "step": "5"}, {"seed": "1", "step": "9"}, {"seed": "2", "step": "9"}]
        self.assertEqual([row["step"] for row in variants.last_of_each_seed(rows)], ["9", "9"])


if __name__ == "__main__":
    unittest.main()
