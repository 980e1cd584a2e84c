#pragma once

#include <CLI/CLI.hpp>
#include <iostream>
#include <string>
#include <vector>

#include "core/base/options.h"

namespace pepeseg {

// Adds -o,--option NAME=VALUE, which sets an option that VisitOptions(options) has, and
// --list-options, which prints them all and ends the program.
template <class Options>
void AddOptionFlags(CLI::App& app, Options& options) {
  app.add_option_function<std::vector<std::string>>(
         "-o,--option",
         [&options](const std::vector<std::string>& settings) {
           for (const std::string& setting : settings) {
             const size_t equals = std::min(setting.find('='), setting.size());
             const absl::Status set =
                 SetByName(options, setting.substr(0, equals),
                           setting.substr(std::min(equals + 1, setting.size())));
             if (!set.ok()) throw CLI::ValidationError("--option", std::string(set.message()));
           }
         },
         "an option of the training, see --list-options")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  app.add_flag_callback(
      "--list-options",
      [&options] {
        for (const OptionText& option : ListOptions(options)) {
          std::cout << option.name << "=" << option.value << "  " << option.range << "\n";
        }
        throw CLI::Success();
      },
      "print the options, their values and ranges");
}

}  // namespace pepeseg
