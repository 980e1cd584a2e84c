#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pepeseg::client::cli {

// Of a command line that was refused: "Did you mean `train`?" for a verb or an option that is
// nearly one, or empty. Does not look at words after a known verb that are not options.
std::string SuggestionFor(const CLI::App& app, int argc, const char* const* argv);

}  // namespace pepeseg::client::cli
