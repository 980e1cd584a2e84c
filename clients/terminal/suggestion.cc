#include "clients/terminal/suggestion.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/nearest_names.h"

namespace pepeseg::client::cli {
namespace {

bool Contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Returns "Did you mean `a` or `b`?"; "" if no name is similar to `word`.
std::string Meant(const std::string& word, const std::vector<std::string>& names) {
  const std::vector<std::string> nearest = NearestNames(word, names);
  if (nearest.empty()) return "";
  std::string text;
  for (const std::string& name : nearest) {
    absl::StrAppend(&text, text.empty() ? "Did you mean `" : " or `", name, "`");
  }
  return text + "?";
}

}  // namespace

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
  // CLI11 stores an option group as a subcommand without a name.
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

std::string SuggestionFor(const CLI::App& app, int argc, const char* const* argv) {
  const std::vector<const CLI::App*> verbs = VerbsOf(app);
  std::vector<std::string> verb_names;
  for (const CLI::App* verb : verbs) verb_names.push_back(verb->get_name());
  std::vector<std::string> options = LongNamesOf(app);
  const CLI::App* verb = nullptr;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (absl::StartsWith(word, "--")) {
      const std::string name = word.substr(0, word.find('='));
      if (name.size() > 2 && !Contains(options, name)) return Meant(name, options);
      // Skip the value of one of the program's own options: "--server VALUE".
      const CLI::Option* known = verb == nullptr ? app.get_option_no_throw(name) : nullptr;
      if (known != nullptr && TakesValue(*known) && word == name) ++i;
    } else if (verb == nullptr && !absl::StartsWith(word, "-")) {
      if (!Contains(verb_names, word)) return Meant(word, verb_names);
      verb = verbs[std::find(verb_names.begin(), verb_names.end(), word) - verb_names.begin()];
      for (const std::string& name : LongNamesOf(*verb)) options.push_back(name);
    }
  }
  return "";
}

}  // namespace pepeseg::client::cli
