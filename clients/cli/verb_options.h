#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

// The verbs and options of the command line's parser, for completions and suggestions.
namespace pepeseg::client::cli {

std::vector<const CLI::App*> VerbsOf(const CLI::App& app);

// The program's own options, or a verb's with those of its groups; --help is among them.
std::vector<const CLI::Option*> OptionsOf(const CLI::App& verb);

// "--point"; positional arguments have none.
std::vector<std::string> LongNamesOf(const CLI::App& verb);

bool TakesValue(const CLI::Option& option);

// The values that an option is limited to; empty: any.
std::vector<std::string> ChoicesOf(const CLI::Option& option);

}  // namespace pepeseg::client::cli
