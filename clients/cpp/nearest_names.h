#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace pepeseg::client {

// The names that somebody who wrote `word` may have meant, the best first, at most three: of few
// edits (a third of the word's length), or with a last part, after '.', that has it as a part.
std::vector<std::string> NearestNames(absl::string_view word,
                                      const std::vector<std::string>& names);

// "; did you mean a, b or c?", or empty for none.
std::string DidYouMean(const std::vector<std::string>& names);

}  // namespace pepeseg::client
