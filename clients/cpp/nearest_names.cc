#include "clients/cpp/nearest_names.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace pepeseg::client {
namespace {

constexpr size_t kMostNames = 3;
constexpr int kFar = 1000;  // distance of a name that does not qualify

// Returns the number of insertions, deletions, replacements and swaps of neighbouring characters
// that turn `a` into `b`: the optimal string alignment distance.
int EditDistance(absl::string_view a, absl::string_view b) {
  // The last three lines of the table of distances between prefixes.
  std::vector<int> before(b.size() + 1), row(b.size() + 1), next(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (size_t i = 1; i <= a.size(); ++i) {
    next[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const int replaced = row[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      next[j] = std::min({replaced, row[j] + 1, next[j - 1] + 1});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        next[j] = std::min(next[j], before[j - 2] + 1);
      }
    }
    std::swap(before, row);
    std::swap(row, next);
  }
  return row[b.size()];
}

absl::string_view LastPart(absl::string_view name) {
  const size_t dot = name.rfind('.');
  return dot == absl::string_view::npos ? name : name.substr(dot + 1);
}

// Returns how far `name` is from `word`; kFar: too far.
int Distance(absl::string_view word, absl::string_view name) {
  const int edits = EditDistance(word, name);
  // One typing error for each three characters.
  if (edits <= std::max<int>(1, static_cast<int>(word.size()) / 3)) return edits;
  const absl::string_view part = LastPart(word);
  const bool dotted = absl::StrContains(name, ".");
  if (dotted && part.size() > 2 && absl::StrContains(LastPart(name), part))
    return edits + 100;  // after all near names
  return kFar;
}

}  // namespace

std::vector<std::string> NearestNames(absl::string_view word,
                                      const std::vector<std::string>& names) {
  std::vector<std::pair<int, std::string>> near;
  for (const std::string& name : names) {
    const int distance = Distance(word, name);
    if (distance < kFar) near.emplace_back(distance, name);
  }
  std::stable_sort(near.begin(), near.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  near.resize(std::min(near.size(), kMostNames));
  std::vector<std::string> nearest;
  for (auto& [distance, name] : near) nearest.push_back(std::move(name));
  return nearest;
}

std::string DidYouMean(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    const char* join = i == 0 ? "; did you mean " : i + 1 == names.size() ? " or " : ", ";
    absl::StrAppend(&text, join, names[i]);
  }
  return text.empty() ? text : text + "?";
}

}  // namespace pepeseg::client
