#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace pepeseg::client {

// Returns at most three of `names` that a person who wrote `word` may have meant, the best first. A
// name qualifies if few edits lead to it (at most a third of the word's length, and one in any
// case), or if it has a '.' and its part after the last '.' contains that of `word`.
std::vector<std::string> NearestNames(absl::string_view word,
                                      const std::vector<std::string>& names);

// Returns "; did you mean a, b or c?", or "" if there are no names.
std::string DidYouMean(const std::vector<std::string>& names);

}  // namespace pepeseg::client
