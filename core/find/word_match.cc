#include "core/find/word_match.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_join.h"
#include "core/base/edit_distance.h"

namespace pepeseg {
namespace {

constexpr double kWithin = 0.9, kBegins = 0.8, kSynonym = 0.7, kNameWithin = 0.5;
constexpr size_t kMinBeginning = 3;  // letters

constexpr std::array<std::pair<absl::string_view, absl::string_view>, 14> kIrregular = {
    {{"children", "child"},
     {"feet", "foot"},
     {"geese", "goose"},
     {"halves", "half"},
     {"knives", "knife"},
     {"leaves", "leaf"},
     {"loaves", "loaf"},
     {"men", "man"},
     {"mice", "mouse"},
     {"people", "person"},
     {"shelves", "shelf"},
     {"teeth", "tooth"},
     {"wolves", "wolf"},
     {"women", "woman"}}};
constexpr std::array<absl::string_view, 4> kArticles = {"the", "a", "an", "all"};

// Returns an English noun in the singular, by its ending.
std::string Singular(std::string word) {
  const auto* const irregular =
      std::ranges::find_if(kIrregular, [&](const auto& plural) { return plural.first == word; });
  if (irregular != kIrregular.end()) return std::string(irregular->second);
  const size_t size = word.size();
  if (size < 4 || word.back() != 's') return word;
  for (const char* const kept : {"ss", "us", "is"}) {
    if (absl::EndsWith(word, kept)) return word;
  }
  if (absl::EndsWith(word, "ies") && size > 4) return word.substr(0, size - 3) + "y";
  for (const char* const ending : {"sses", "shes", "ches", "xes", "zes"}) {
    if (absl::EndsWith(word, ending)) return word.substr(0, size - 2);
  }
  return word.substr(0, size - 1);
}

bool IsWordByte(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) ||
         static_cast<unsigned char>(c) >= 0x80;
}

bool Contains(const std::vector<std::string>& words, const std::string& word) {
  return std::ranges::find(words, word) != words.end();
}

// Returns how well a word fits one of a name: 1, kBegins, kSynonym or 0.
double WordScore(const std::string& word, const std::vector<std::string>& name,
                 const SynonymsOf& synonyms_of) {
  if (Contains(name, word)) return 1;
  if (word.size() >= kMinBeginning &&
      std::ranges::any_of(name, [&](const auto& w) { return absl::StartsWith(w, word); })) {
    return kBegins;
  }
  const std::vector<std::string> synonyms = synonyms_of(word);
  return std::ranges::any_of(name, [&](const auto& w) { return Contains(synonyms, w); }) ? kSynonym
                                                                                         : 0;
}

}  // namespace

std::vector<std::string> WordsOf(absl::string_view text) {
  std::vector<std::string> words;
  std::string word;
  const auto end_word = [&] {
    const bool article = std::ranges::find(kArticles, word) != kArticles.end();
    if (!word.empty() && !article) words.push_back(Singular(word));
    word.clear();
  };
  for (const char c : text) {
    IsWordByte(c) ? word.push_back(absl::ascii_tolower(static_cast<unsigned char>(c))) : end_word();
  }
  end_word();
  return words;
}

double NameScore(absl::string_view text, absl::string_view name, const SynonymsOf& synonyms_of) {
  const std::vector<std::string> asked = WordsOf(text), called = WordsOf(name);
  if (asked.empty() || called.empty()) return 0;
  if (asked == called) return 1;
  double score = kWithin;
  for (const std::string& word : asked) {
    score = std::min(score, WordScore(word, called, synonyms_of));
  }
  if (score > 0) return score;
  const std::vector<std::string> phrases = synonyms_of(absl::StrJoin(asked, " "));
  if (Contains(phrases, absl::StrJoin(called, " "))) return kSynonym;
  const bool within =
      std::ranges::all_of(called, [&](const auto& w) { return Contains(asked, w); });
  return within ? kNameWithin : 0;
}

std::vector<std::string> AlmostSpelt(absl::string_view text, const std::vector<std::string>& known,
                                     size_t max) {
  const std::string asked = absl::StrJoin(WordsOf(text), " ");
  std::vector<std::pair<size_t, std::string>> near;
  for (const std::string& word : known) {
    const size_t distance = EditDistance(asked, absl::StrJoin(WordsOf(word), " "));
    // A third of the letters may differ.
    if (distance * 3 <= std::max(asked.size(), size_t{3})) near.emplace_back(distance, word);
  }
  std::ranges::stable_sort(near, {}, [](const auto& n) { return n.first; });
  std::vector<std::string> words;
  for (const auto& [distance, word] : near) {
    if (words.size() < max && !Contains(words, word)) words.push_back(word);
  }
  return words;
}

}  // namespace pepeseg
