#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace pepeseg {

// Returns the synonyms of an English noun, lower case; words of a phrase are separated by spaces.
using SynonymsOf = std::function<std::vector<std::string>(const std::string& noun)>;

// Returns the words of a text in order: lower case (of ASCII letters), in the singular, without
// articles. Words are runs of letters and digits; bytes beyond ASCII count as letters.
std::vector<std::string> WordsOf(absl::string_view text);

// Returns how well a text names what is called `name`, in [0, 1], after WordsOf of both:
//   1     the same words
//   0.9   all words of the text are words of the name
//   0.8   where a word of the text, of at least three letters, only begins a word of the name
//   0.7   where it is a synonym of one, or the text as a whole one of the name
//   0.5   all words of the name are words of the text
//   0     neither
double NameScore(absl::string_view text, absl::string_view name, const SynonymsOf& synonyms_of);

// Returns up to `max` of the known words that are spelt almost like a text, the most similar first.
std::vector<std::string> AlmostSpelt(absl::string_view text, const std::vector<std::string>& known,
                                     size_t max);

}  // namespace pepeseg
