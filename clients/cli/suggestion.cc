#include "clients/cli/suggestion.h"

#include <algorithm>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "clients/cli/verb_options.h"
#include "clients/cpp/nearest_names.h"

namespace pepeseg::client::cli {
namespace {

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

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
      if (name.size() > 2 && !Has(options, name)) return Meant(name, options);
      // The value of an option of the program's own.
      const CLI::Option* known = verb == nullptr ? app.get_option_no_throw(name) : nullptr;
      if (known != nullptr && TakesValue(*known) && word == name) ++i;
    } else if (verb == nullptr && !absl::StartsWith(word, "-")) {
      if (!Has(verb_names, word)) return Meant(word, verb_names);
      verb = verbs[std::find(verb_names.begin(), verb_names.end(), word) - verb_names.begin()];
      for (const std::string& name : LongNamesOf(*verb)) options.push_back(name);
    }
  }
  return "";
}

}  // namespace pepeseg::client::cli
