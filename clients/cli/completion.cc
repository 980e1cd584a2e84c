// The verb "completion": prints a script that completes command lines in bash or zsh. The script is
// generated from the parser, so that it has every verb, option and value. zsh runs it by its own
// bashcompinit.
#include <algorithm>
#include <memory>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "clients/cli/verbs.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/suggestion.h"

namespace pepeseg::client::cli {
namespace {

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
std::string Script(const CLI::App& app) {
  std::vector<std::string> names;
  std::string values, words;
  for (const CLI::App* verb : VerbsOf(app)) {
    names.push_back(verb->get_name());
    AppendValueCases(*verb, verb->get_name(), values);
    absl::StrAppend(&words, "    ", verb->get_name(), ") offered='",
                    absl::StrJoin(WordsOf(*verb), " "), "' ;;\n");
  }
  const std::string own = absl::StrJoin(LongNamesOf(app), " ");
  return absl::StrReplaceAll(
      R"(#compdef pepeseg
# Completion of pepeseg for bash:
#   pepeseg completion bash > ~/.local/share/bash-completion/completions/pepeseg
# and for zsh: put it as _pepeseg into a folder of $fpath, or source it.
if [[ -n ${ZSH_VERSION-} ]]; then autoload -U +X bashcompinit && bashcompinit; fi
_pepeseg_options() {
  [[ -z ${ZSH_VERSION-} ]] || setopt localoptions bash_rematch
  local server=()
  if [[ ${COMP_LINE-} =~ [[:space:]]--server[=[:space:]]+([^[:space:]]+) ]]; then
    server=(--server "${BASH_REMATCH[1]}")
  fi
  timeout 3 "${COMP_WORDS[0]}" "${server[@]}" train --list-options 2>/dev/null |
    sed -n 's/^\([a-z_]*[.][a-z_]*\) .*/\1=/p'
}
_pepeseg() {
  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
  local verb= word= offered= values=
  for word in "${COMP_WORDS[@]:1:$((COMP_CWORD - 1))}"; do
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
    '') offered='@NAMES@' ;;
@WORDS@  esac
  COMPREPLY=($(compgen -W "$offered @OWN@" -- "$current"))
  if [[ -n $verb && $current != -* ]]; then
    COMPREPLY=($(compgen -W "$offered" -- "$current" | grep -v '^-') $(compgen -f -- "$current"))
  fi
}
complete -o filenames -F _pepeseg pepeseg
# The first call of zsh, which has read this file for it.
if [[ -n ${ZSH_VERSION-} && ${funcstack[1]-} == _pepeseg ]]; then
  _bash_complete -o filenames -F _pepeseg
fi
)",
      {{"@BARRED@", absl::StrJoin(names, "|")},
       {"@NAMES@", absl::StrJoin(names, " ")},
       {"@VALUES@", values},
       {"@WORDS@", words},
       {"@OWN@", own}});
}

}  // namespace

void AddCompletion(CLI::App& app, Shell& shell) {
  auto name = std::make_shared<std::string>();
  CLI::App* verb = app.add_subcommand("completion", "Print a script that completes command lines");
  verb->add_option("SHELL", *name, "bash or zsh")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh"}));
  verb->callback([name, &app, &shell] {
    shell.verb = [name, &app] {
      Print(Script(app));
      return absl::OkStatus();
    };
  });
}

}  // namespace pepeseg::client::cli
