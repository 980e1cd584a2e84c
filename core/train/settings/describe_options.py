#!/usr/bin/env python3
"""Writes OptionDescriptions() of training_settings.h from the comments on the members of options structs.

describe_options.py OUTPUT PREFIX:STRUCT:HEADER...

The comment above a member is the description of the option PREFIX.MEMBER. A member without a
comment, a line that is neither a comment nor "TYPE MEMBER = DEFAULT;", and a struct that is not in
its header are errors.
"""

import json
import re
import sys

SOURCE = """// Made by core/train/settings/describe_options.py.
#include "core/train/settings/training_settings.h"

namespace pepeseg {

const std::map<absl::string_view, absl::string_view>& OptionDescriptions() {
  static const auto& texts = *new std::map<absl::string_view, absl::string_view>{
%s  };
  return texts;
}

}  // namespace pepeseg
"""


def members(header, struct):
    """Returns (name, comment) of each member of a struct."""
    with open(header, encoding="utf-8") as file:
        body = re.search(rf"^struct {struct} {{\n(.*?)^}};", file.read(), re.M | re.S)
    if body is None:
        sys.exit(f"{header} has no struct {struct}")
    comment = []
    for line in body[1].splitlines():
        line = line.strip()
        member = re.match(r"[\w:<> ]+ (\w+) = .*;$", line)
        if line.startswith("//"):
            comment.append(line[2:].strip())
            continue
        if line and member is None:
            sys.exit(f'{header}: {struct}: "{line}" is not one line "TYPE MEMBER = DEFAULT;"')
        if line and not comment:
            sys.exit(f"{header}: {struct}::{member[1]} has no comment above it")
        if line:
            yield member[1], " ".join(comment)
        comment = []


def main():
    rows = ""
    for part in sys.argv[2:]:
        prefix, struct, header = part.split(":")
        for name, text in members(header, struct):
            rows += f"      {{{json.dumps(f'{prefix}.{name}')}, {json.dumps(text)}}},\n"
    with open(sys.argv[1], "w", encoding="utf-8") as file:
        file.write(SOURCE % rows)


if __name__ == "__main__":
    main()
