// The verb "completion": prints a script that completes command lines in bash or zsh. The script is
// generated from the parser, so that it has every verb, option and value.
#include "clients/cli/completion.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "clients/cli/shell.h"
#include "clients/cpp/nearest_names.h"

namespace pepeseg::client::cli {
namespace {

std::vector<const CLI::App*> VerbsOf(const CLI::App& app) {
  std::vector<const CLI::App*> verbs;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!verb->get_name().empty()) verbs.push_back(verb);
  }
  return verbs;
}

// Returns the options of a verb with those of its option groups, or the program's own options.
// --help is one of them.
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

// Returns the long names of all options: "--point". Positional arguments have none.
std::vector<std::string> LongNamesOf(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::Option* option : OptionsOf(verb)) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

bool TakesValue(const CLI::Option& option) { return option.get_type_size_max() > 0; }

// Returns the values that an option is limited to; empty: it takes any value.
std::vector<std::string> ChoicesOf(const CLI::Option& option) {
  // CLI::IsMember appends its members to the name of the type: "TEXT:{depth,disparity}".
  const std::string type = option.get_type_name();
  const size_t begin = type.find('{'), end = type.find('}');
  if (begin == std::string::npos || end == std::string::npos || end < begin) return {};
  return absl::StrSplit(type.substr(begin + 1, end - begin - 1), ',');
}

// Returns true for -o,--option, whose values are NAME=VALUE.
bool IsTrainingOption(const CLI::Option& option) { return option.check_lname("option"); }

// Returns "-o", "--option".
std::vector<std::string> NamesOf(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

// Returns the words that may follow a verb: its options, and the choices of its positional
// arguments.
std::vector<std::string> WordsOf(const CLI::App& verb) {
  std::vector<std::string> words = LongNamesOf(verb);
  for (const CLI::Option* option : OptionsOf(verb)) {
    if (option->nonpositional()) continue;
    for (const std::string& choice : ChoicesOf(*option)) words.push_back(choice);
  }
  return words;
}

// Returns "(preview standard best)", or zsh's function for file names if there are no values.
std::string ZshAction(const std::vector<std::string>& values) {
  return values.empty() ? "_files" : absl::StrCat("(", absl::StrJoin(values, " "), ")");
}

// Appends lines "    train:--preset) values='preview standard best' ;;". The options of a training
// are the server's: the script asks it, for at most three seconds.
void AppendValueCases(const CLI::App& verb, const std::string& name, std::string& script) {
  for (const CLI::Option* option : OptionsOf(verb)) {
    const std::string values = IsTrainingOption(*option)
                                   ? "$(_pepeseg_options)"
                                   : absl::StrCat("'", absl::StrJoin(ChoicesOf(*option), " "), "'");
    if (values == "''" || !option->nonpositional()) continue;
    const std::string prefix = name + ":";
    absl::StrAppend(&script, "    ", prefix, absl::StrJoin(NamesOf(*option), "|" + prefix),
                    ") values=", values, " ;;\n");
  }
}

// The function _pepeseg finds the verb among the words before the cursor, then completes the value
// of the option before the cursor, or else a verb, an option or a file name.
std::string BashScript(const CLI::App& app) {
  std::vector<std::string> names;
  std::string values, words;
  for (const CLI::App* verb : VerbsOf(app)) {
    names.push_back(verb->get_name());
    AppendValueCases(*verb, verb->get_name(), values);
    absl::StrAppend(&words, "    ", verb->get_name(), ") words='",
                    absl::StrJoin(WordsOf(*verb), " "), "' ;;\n");
  }
  const std::string own = absl::StrJoin(LongNamesOf(app), " ");
  return absl::StrReplaceAll(
      R"(# Completion of pepeseg for bash:
#   pepeseg completion bash > ~/.local/share/bash-completion/completions/pepeseg
_pepeseg_options() {
  local server=()
  if [[ ${COMP_LINE-} =~ [[:space:]]--server[=[:space:]]+([^[:space:]]+) ]]; then
    server=(--server "${BASH_REMATCH[1]}")
  fi
  timeout 3 "${COMP_WORDS[0]}" "${server[@]}" train --list-options 2>/dev/null |
    sed -n 's/^\([a-z_]*[.][a-z_]*\) .*/\1=/p'
}
_pepeseg() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
  local verb= word= words= values=
  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do
    case $word in
    @BARRED@) verb=$word; break ;;
    esac
  done
  case $verb:$before in
@VALUES@  esac
  if [[ -n $values ]]; then
    COMPREPLY=($(compgen -W "$values" -- "$current"))
    [[ ${COMPREPLY[0]-} != *= ]] || compopt -o nospace 2>/dev/null
    return
  fi
  case $verb in
    '') words='@NAMES@' ;;
@WORDS@  esac
  COMPREPLY=($(compgen -W "$words @OWN@" -- "$current"))
  if [[ -n $verb && $current != -* ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$current" | grep -v '^-') $(compgen -f -- "$current"))
  fi
}
complete -o filenames -F _pepeseg pepeseg
)",
      {{"@BARRED@", absl::StrJoin(names, "|")},
       {"@NAMES@", absl::StrJoin(names, " ")},
       {"@VALUES@", values},
       {"@WORDS@", words},
       {"@OWN@", own}});
}

// Escapes a description for the brackets of a zsh spec within single quotes.
std::string ZshText(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"'", "'\\''"}, {"[", "("}, {"]", ")"}, {":", ","}, {"\\", ""}, {"\n", " "}});
}

// Appends lines "'*--preset[Which options]:value:(preview standard best)'".
void AppendZshSpecs(const CLI::App& verb, const std::string& indent, std::string& script) {
  for (const CLI::Option* option : OptionsOf(verb)) {
    const std::string value = TakesValue(*option) ? ":value:" + ZshAction(ChoicesOf(*option)) : "";
    for (const std::string& name : NamesOf(*option)) {
      absl::StrAppend(&script, indent, "'*", name, "[", ZshText(option->get_description()), "]",
                      value, "'\n");
    }
  }
}

std::string ZshScript(const CLI::App& app) {
  std::string verbs, own, cases;
  AppendZshSpecs(app, "    ", own);
  for (const CLI::App* verb : VerbsOf(app)) {
    absl::StrAppend(&verbs, "    '", verb->get_name(), ":", ZshText(verb->get_description()),
                    "'\n");
    std::string specs;
    AppendZshSpecs(*verb, "      ", specs);
    std::vector<std::string> choices;
    for (const std::string& word : WordsOf(*verb)) {
      if (word[0] != '-') choices.push_back(word);
    }
    absl::StrAppend(&cases, "    ", verb->get_name(), ") specs=(\n", specs,
                    "      '*:word:", ZshAction(choices), "') ;;\n");
  }
  return absl::StrReplaceAll(R"(#compdef pepeseg
# Completion of pepeseg for zsh: put it as _pepeseg into a folder of $fpath, or source it.
_pepeseg() {
  local state verb
  local -a verbs own specs
  verbs=(
@VERBS@  )
  own=(
@OWN@  )
  _arguments -C $own '1:verb:->verb' '*::word:->word'
  case $state in
  verb) _describe verb verbs ;;
  word)
    verb=$words[1]
    case $verb in
@CASES@    esac
    _arguments $own $specs ;;
  esac
}
if [[ $funcstack[1] == _pepeseg ]]; then _pepeseg "$@"; else compdef _pepeseg pepeseg; fi
)",
                             {{"@VERBS@", verbs}, {"@OWN@", own}, {"@CASES@", cases}});
}

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

void AddCompletion(CLI::App& app, Shell& shell) {
  auto name = std::make_shared<std::string>();
  CLI::App* verb = app.add_subcommand("completion", "Print a script that completes command lines");
  verb->add_option("SHELL", *name, "bash or zsh")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh"}));
  verb->callback([name, &app, &shell] {
    shell.verb = [name, &app] {
      Print(*name == "bash" ? BashScript(app) : ZshScript(app));
      return absl::OkStatus();
    };
  });
}

}  // namespace pepeseg::client::cli
