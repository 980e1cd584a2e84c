#!/usr/bin/env python3
"""Tests core/train/settings/describe_options.py: no member of an options struct is passed over.

describe_options_test.py DESCRIBE_OPTIONS_PY
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = sys.argv.pop(1)


class DescribeOptions(unittest.TestCase):
    def run_on(self, body):
        """Returns the exit code, the source that is written ("" if none) and the errors."""
        with tempfile.TemporaryDirectory() as folder:
            header, out = pathlib.Path(folder, "options.h"), pathlib.Path(folder, "out.cc")
            header.write_text(f"struct Options {{\n{body}}};\n", encoding="utf-8")
            command = [sys.executable, SCRIPT, str(out), f"part:Options:{header}"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            return done.returncode, out.read_text() if out.exists() else "", done.stderr

    def test_the_comment_above_a_member_describes_it(self):
        code, source, _ = self.run_on(
            "  // A group.\n\n  // First\n  // line.\n  int a = 1;\n  // List.\n"
            "  std::vector<std::string> b = {};\n"
        )
        self.assertEqual(code, 0)
        self.assertIn('{"part.a", "First line."},\n', source)
        self.assertIn('{"part.b", "List."},\n', source)
        self.assertNotIn("A group", source)

    def test_members_that_are_not_one_plain_line_are_refused(self):
        for member in ("int a;", "int a = 1;  // one", "double a =\n      1.0 / 3;", "int a{1};"):
            code, source, errors = self.run_on(f"  // Text.\n  {member}\n")
            self.assertEqual((code, source), (1, ""), member)
            self.assertIn("is not one line", errors)

    def test_members_without_a_comment_are_refused(self):
        code, _, errors = self.run_on("  // Text.\n  int a = 1;\n  int b = 2;\n")
        self.assertEqual(code, 1)
        self.assertIn("Options::b has no comment above it", errors)


if __name__ == "__main__":
    unittest.main()
