#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

// Options are stated once. A struct of options has a function VisitOptions next to it, which gives
// one row for each member: its name, the member, and the values that it takes. Validation, setting
// by name, the list for users and the flags of benchmarks are made from these rows. The comment on
// the member is its only description (describe_options.py).
namespace pepeseg {

// Values that a number may have: low <= value <= high, or `also`.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool open = false;                // `low` is not in the range
  std::optional<double> also = {};  // a value outside the range with a meaning of its own
};

// A member of an enum type, and the word of each value.
struct WordField {
  void* field;
  int (*get)(const void* field);
  void (*set)(void* field, int value);
  std::vector<std::pair<std::string, int>> words;
};
template <class Enum>
WordField WordsOf(Enum* field, const std::vector<std::pair<const char*, Enum>>& words) {
  WordField result = {
      field,
      [](const void* at) { return static_cast<int>(*static_cast<const Enum*>(at)); },
      [](void* at, int value) { *static_cast<Enum*>(at) = static_cast<Enum>(value); },
      {}};
  for (const auto& [word, value] : words) {
    result.words.emplace_back(word, static_cast<int>(value));
  }
  return result;
}

// A member that is a list of names.
struct NamesField {
  std::vector<std::string>* names;
  size_t max_names;
};

// A row of VisitOptions. bool and uint64_t take all values of their type, so they have no range.
struct Option {
  std::string name;
  std::variant<bool*, int*, int64_t*, uint64_t*, float*, double*, WordField, NamesField> field;
  Range range = {};
};
using OptionVisitor = absl::FunctionRef<void(const Option& option)>;

// An option as text, for users.
struct OptionText {
  std::string name;
  std::string value;  // SetOption takes it and sets the same value; lists: separated by commas
  std::string range;  // "[0, 1]", "0 or [2, 100]", "true or false", "quantiles, even or min_max"
};

// Returns the option as text.
OptionText TextOf(const Option& option);

// Returns INVALID_ARGUMENT "NAME is VALUE, must be in [LOW, HIGH]" unless the value is allowed. NaN
// never is.
absl::Status CheckOption(const Option& option);

// Sets the option from text: a number, "true" or "false", a word, or a name to be added to a list.
// INVALID_ARGUMENT, which names the option, the text and the range, leaves the option as it was.
absl::Status SetOption(const Option& option, absl::string_view text);

// Returns INVALID_ARGUMENT for a name that no option has, with the names that are nearest to it.
absl::Status UnknownOption(absl::string_view name, const std::vector<std::string>& names);

// Calls `visit` with the options of a part of a larger struct, whose names get "PREFIX." before
// them.
template <class Options>
void VisitPart(absl::string_view prefix, Options& part, OptionVisitor visit) {
  VisitOptions(part, [&](Option option) {
    option.name = absl::StrCat(prefix, ".", option.name);
    visit(option);
  });
}

// Returns the error of the first option whose value is not allowed, see CheckOption. Takes a copy,
// because rows point to members that can be set.
template <class Options>
absl::Status CheckOptions(Options options) {
  absl::Status status;
  VisitOptions(options, [&](const Option& option) { status.Update(CheckOption(option)); });
  return status;
}

// Sets the option of this name from text. Errors are those of SetOption and UnknownOption.
template <class Options>
absl::Status SetByName(Options& options, absl::string_view name, absl::string_view text) {
  std::optional<absl::Status> status;
  std::vector<std::string> names;
  VisitOptions(options, [&](const Option& option) {
    names.push_back(option.name);
    if (option.name == name) status = SetOption(option, text);
  });
  return status ? *status : UnknownOption(name, names);
}

// Returns all options as text, in the order of their rows.
template <class Options>
std::vector<OptionText> ListOptions(Options options) {
  std::vector<OptionText> list;
  VisitOptions(options, [&](const Option& option) { list.push_back(TextOf(option)); });
  return list;
}

}  // namespace pepeseg
