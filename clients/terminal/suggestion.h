#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

// The verbs and options that a parser has, and the one that a user meant after a typing error.
namespace pepeseg::client::cli {

std::vector<const CLI::App*> VerbsOf(const CLI::App& app);

// Returns the options of a verb with those of its option groups, or the program's own options.
// --help is one of them.
std::vector<const CLI::Option*> OptionsOf(const CLI::App& verb);

// Returns the long names of all options: "--point". Positional arguments have none.
std::vector<std::string> LongNamesOf(const CLI::App& verb);

bool TakesValue(const CLI::Option& option);

// Returns "Did you mean `train`?" if a refused command line has a word that is similar to a verb or
// an option; otherwise "". After a known verb, only words that begin with "--" are examined.
std::string SuggestionFor(const CLI::App& app, int argc, const char* const* argv);

}  // namespace pepeseg::client::cli
