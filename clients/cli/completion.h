#pragma once

#include <CLI/CLI.hpp>
#include <string>

// Verbs and options that a user means: completed by the shell, or suggested after a typing error.
namespace pepeseg::client::cli {

// Returns "Did you mean `train`?" if a refused command line has a word that is similar to a verb or
// an option; otherwise "". After a known verb, only words that begin with "--" are examined.
std::string SuggestionFor(const CLI::App& app, int argc, const char* const* argv);

}  // namespace pepeseg::client::cli
