#include "clients/cli/verb_options.h"

#include "absl/strings/str_split.h"

namespace pepeseg::client::cli {

std::vector<const CLI::App*> VerbsOf(const CLI::App& app) {
  std::vector<const CLI::App*> verbs;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!verb->get_name().empty()) verbs.push_back(verb);
  }
  return verbs;
}

std::vector<const CLI::Option*> OptionsOf(const CLI::App& verb) {
  std::vector<const CLI::Option*> options =
      verb.get_options([](const CLI::Option*) { return true; });
  // Groups are verbs without a name.
  for (const CLI::App* group : verb.get_subcommands([](const CLI::App*) { return true; })) {
    if (!group->get_name().empty()) continue;
    for (const CLI::Option* option : OptionsOf(*group)) options.push_back(option);
  }
  return options;
}

std::vector<std::string> LongNamesOf(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::Option* option : OptionsOf(verb)) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

bool TakesValue(const CLI::Option& option) { return option.get_type_size_max() > 0; }

std::vector<std::string> ChoicesOf(const CLI::Option& option) {
  // CLI::IsMember appends its members to the type's name: "TEXT:{depth,disparity}".
  const std::string type = option.get_type_name();
  const size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos || end < begin) return {};
  return absl::StrSplit(type.substr(begin + 1, end - begin - 1), ',');
}

}  // namespace pepeseg::client::cli
