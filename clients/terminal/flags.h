#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "clients/cpp/client.h"
#include "pepeseg/v1/prompt.pb.h"

// Flags that verbs of several programs share, and what they become.
namespace pepeseg::client::cli {

// Adds a part to a prompt. `kind` says what the text is:
//   point, negative          X,Y
//   mean                     X,Y: one of the points of point_mean
//   box                      X,Y,WIDTH,HEIGHT
//   scribble, not-scribble   "X,Y X,Y ...": a stroke
//   scribbles, not-scribbles  a PNG with strokes
//   mask                     a PNG
//   previous-mask            a PNG: the answer to all points but the last
//   label                    the id of a label
// INVALID_ARGUMENT: the text is malformed. LocalFileError: the file cannot be read.
absl::Status AddToPrompt(absl::string_view kind, const std::string& text, v1::Prompt& prompt);

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
