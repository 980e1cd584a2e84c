#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/prompt.pb.h"

// Flags that verbs of several programs share, and what they become.
namespace pepeseg::client::cli {

// Parses a point "120,88.5" and a box "10,20,100,80". INVALID_ARGUMENT: it is malformed.
absl::StatusOr<v1::PointsPrompt::Point> ParsePoint(const std::string& text, bool negative);
absl::StatusOr<v1::BoxPrompt> ParseBox(const std::string& text);

// Adds --frame photograph|view: the image whose pixels points, boxes, masks and pictures are in.
// Sets `frame` to its default, photograph.
CLI::Option* AddFrameFlag(CLI::App& verb, v1::PixelFrame& frame);

// Reads the names that one value of an option has: those in a text file, one a line, if there is a
// file of that name, otherwise the value's parts between commas. Empty names are dropped. A file
// with a zero byte, such as a photograph, is not text: its own name is meant.
std::vector<std::string> ReadNames(const std::string& value);
// Adds an option of names, which may be repeated; each value is read by ReadNames. `help` says what
// the names are of, and how the option reads them is added to it.
CLI::Option* AddNamesFlag(CLI::App& verb, const std::string& flag, std::vector<std::string>& names,
                          const std::string& help);

}  // namespace pepeseg::client::cli
