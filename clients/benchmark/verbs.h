#pragma once

#include <CLI/CLI.hpp>

#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {

// Each adds a verb with its options to the parser. Parsing a command line with that verb sets
// shell.verb. Both arguments must outlive the parser.
void AddEvaluate(CLI::App& app, Shell& shell);
void AddDemo(CLI::App& app, Shell& shell);
void AddCurves(CLI::App& app, Shell& shell);
void AddSuite(CLI::App& app, Shell& shell);

}  // namespace pepeseg::client::cli
