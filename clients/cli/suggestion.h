#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace pepeseg::client::cli {

// Returns "Did you mean `train`?" if a refused command line has a word that is nearly a verb or an
// option, else "". Words after a known verb are looked at only if they are options.
std::string SuggestionFor(const CLI::App& app, int argc, const char* const* argv);

}  // namespace pepeseg::client::cli
