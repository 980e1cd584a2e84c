#include "core/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_join.h"
#include "core/base/edit_distance.h"

namespace pepeseg {
namespace {

template <class T>
constexpr bool kIsNumber = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;

// Returns the shortest text that reads back as the same number.
template <class T>
std::string NumberText(T value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

// Returns a bound of the range of a T as text. 1e-12 is not a float: the range of one ends there
// all the same.
template <class T>
std::string BoundText(double bound) {
  if constexpr (std::is_integral_v<T>) return NumberText(static_cast<int64_t>(bound));
  return NumberText(bound);
}

// Returns "[0, 1]" or "-1 or [0, 10]", with `in` before the bracket.
template <class T>
std::string RangeText(const Range& range, absl::string_view in) {
  // uint64_t is for seeds, which have no range.
  if constexpr (std::is_same_v<T, uint64_t>) return absl::StrCat(in, "[0, ", ~uint64_t{0}, "]");
  const std::string also = range.also ? BoundText<T>(*range.also) + " or " : "";
  return absl::StrCat(also, in, range.open ? "(" : "[", BoundText<T>(range.low), ", ",
                      BoundText<T>(range.high), "]");
}

template <class T>
bool IsIn(const Range& range, T value) {
  if constexpr (std::is_same_v<T, uint64_t>) return true;
  // Bounds are compared in the member's own type, so that a float may be 0.9.
  const T low = static_cast<T>(range.low), high = static_cast<T>(range.high);
  if (range.also && value == static_cast<T>(*range.also)) return true;
  return (range.open ? value > low : value >= low) && value <= high;
}

template <class T>
bool Parse(absl::string_view text, T& value) {
  if constexpr (std::is_same_v<T, bool>) return absl::SimpleAtob(text, &value);
  if constexpr (std::is_same_v<T, float>) return absl::SimpleAtof(text, &value);
  if constexpr (std::is_same_v<T, double>) return absl::SimpleAtod(text, &value);
  if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
    return absl::SimpleAtoi(text, &value);
  }
}

// Returns what the brackets of a range follow: numbers "in" it or, where the text is not a number
// of this type, which type that is.
template <class T>
absl::string_view BeforeBracket(const T* /*field*/, absl::string_view text) {
  T value = {};
  if (Parse(text, value)) return "in ";
  return std::is_integral_v<T> ? "a whole number in " : "a number in ";
}
absl::string_view BeforeBracket(const WordField& /*field*/, absl::string_view /*text*/) {
  return "";
}
absl::string_view BeforeBracket(const NamesField& /*field*/, absl::string_view /*text*/) {
  return "";
}

// Returns "a, b or c".
std::string AnyOf(const std::vector<std::pair<std::string, int>>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i) {
    const char* between = i == 0 ? "" : i + 1 == words.size() ? " or " : ", ";
    absl::StrAppend(&text, between, words[i].first);
  }
  return text;
}

// Each kind of member as text, and its range. `in` stands before the brackets of a range.
template <class T>
std::string ValueText(const T* field) {
  if constexpr (std::is_same_v<T, bool>) return *field ? "true" : "false";
  if constexpr (kIsNumber<T>) return NumberText(*field);
}
std::string ValueText(const WordField& field) {
  const int value = field.get(field.field);
  for (const auto& word : field.words) {
    if (word.second == value) return word.first;
  }
  return absl::StrCat(value);
}
std::string ValueText(const NamesField& field) { return absl::StrJoin(*field.names, ","); }

template <class T>
std::string AllowedText(const T* /*field*/, const Range& range, absl::string_view in) {
  if constexpr (std::is_same_v<T, bool>) return "true or false";
  if constexpr (kIsNumber<T>) return RangeText<T>(range, in);
}
std::string AllowedText(const WordField& field, const Range& /*range*/, absl::string_view /*in*/) {
  return AnyOf(field.words);
}
std::string AllowedText(const NamesField& field, const Range& /*range*/, absl::string_view /*in*/) {
  return absl::StrCat("names, at most ", field.max_names);
}

template <class T>
bool IsAllowed(const T* field, const Range& range) {
  if constexpr (kIsNumber<T>) return IsIn(range, *field);
  return true;
}
bool IsAllowed(const WordField& field, const Range& /*range*/) {
  const int value = field.get(field.field);
  return std::any_of(field.words.begin(), field.words.end(),
                     [&](const auto& word) { return word.second == value; });
}
bool IsAllowed(const NamesField& field, const Range& /*range*/) {
  return field.names->size() <= field.max_names;
}

// Sets the member and returns true if the text is an allowed value of it.
template <class T>
bool SetField(T* field, const Range& range, absl::string_view text) {
  T value = {};
  if (!Parse(text, value) || !IsAllowed(&value, range)) return false;
  *field = value;
  return true;
}
bool SetField(const WordField& field, const Range& /*range*/, absl::string_view text) {
  for (const auto& word : field.words) {
    if (word.first != text) continue;
    field.set(field.field, word.second);
    return true;
  }
  return false;
}
bool SetField(const NamesField& field, const Range& /*range*/, absl::string_view text) {
  if (text.empty() || field.names->size() >= field.max_names) return false;
  field.names->emplace_back(text);
  return true;
}

std::string AllowedText(const Option& option, absl::string_view in) {
  return std::visit([&](const auto& field) { return AllowedText(field, option.range, in); },
                    option.field);
}

// Longest text of a user that messages have, and that is compared with names, bytes.
constexpr size_t kLongestText = 100;

// Returns the text in quotes. Of a longer one, the beginning, cut between characters of UTF-8.
std::string Quoted(absl::string_view text) {
  if (text.size() <= kLongestText) return absl::StrCat("\"", text, "\"");
  size_t end = kLongestText;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return absl::StrCat("\"", text.substr(0, end), "...\"");
}

absl::string_view LastPart(absl::string_view name) { return name.substr(name.rfind('.') + 1); }

// Returns whether `name` may have been meant by `word`: one typing error for each three characters
// of the word's last part, or that part in the name's last part.
bool IsNear(absl::string_view word, absl::string_view name) {
  if (word.size() > kLongestText) return false;
  const absl::string_view part = LastPart(word);
  if (EditDistance(word, name) <= std::max<size_t>(1, part.size() / 3)) return true;
  return part.size() > 2 && absl::StrContains(LastPart(name), part);
}

}  // namespace

OptionText TextOf(const Option& option) {
  return {option.name, std::visit([](const auto& field) { return ValueText(field); }, option.field),
          AllowedText(option, "")};
}

absl::Status CheckOption(const Option& option) {
  const bool allowed =
      std::visit([&](const auto& field) { return IsAllowed(field, option.range); }, option.field);
  if (allowed) return absl::OkStatus();
  if (const auto* field = std::get_if<NamesField>(&option.field)) {
    return absl::InvalidArgumentError(absl::StrCat(option.name, " has ", field->names->size(),
                                                   " names, the limit is ", field->max_names));
  }
  return absl::InvalidArgumentError(absl::StrCat(option.name, " is ", TextOf(option).value,
                                                 ", must be ", AllowedText(option, "in ")));
}

absl::Status SetOption(const Option& option, absl::string_view text) {
  const bool set = std::visit(
      [&](const auto& field) { return SetField(field, option.range, text); }, option.field);
  if (set) return absl::OkStatus();
  if (const auto* list = std::get_if<NamesField>(&option.field)) {
    return absl::InvalidArgumentError(
        text.empty() ? absl::StrCat(option.name, " has an empty name")
                     : absl::StrCat(option.name, " has more than ", list->max_names, " names"));
  }
  const absl::string_view in =
      std::visit([&](const auto& field) { return BeforeBracket(field, text); }, option.field);
  return absl::InvalidArgumentError(
      absl::StrCat(option.name, " is ", Quoted(text), ", must be ", AllowedText(option, in)));
}

absl::Status UnknownOption(absl::string_view name, const std::vector<std::string>& names) {
  constexpr size_t kNamed = 3;
  std::vector<std::pair<size_t, std::string>> near;
  for (const std::string& known : names) {
    if (IsNear(name, known)) near.emplace_back(EditDistance(name, known), known);
  }
  std::sort(near.begin(), near.end());
  near.resize(std::min(near.size(), kNamed));
  const std::string meant = absl::StrJoin(
      near, " or ", [](std::string* out, const auto& one) { out->append(one.second); });
  return absl::InvalidArgumentError(absl::StrCat("unknown option ", Quoted(name),
                                                 meant.empty() ? "" : "; did you mean ", meant,
                                                 meant.empty() ? "" : "?"));
}

}  // namespace pepeseg
