#include "core/find/wordnet.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr size_t kMostMeanings = 4;
constexpr size_t kMaxIndexBytes = size_t{64} << 20;

using Fields = std::vector<std::string>;

Fields FieldsOf(absl::string_view line) { return absl::StrSplit(line, ' ', absl::SkipEmpty()); }

// Returns a field as a number, or -1.
int64_t NumberAt(const Fields& fields, size_t i) {
  int64_t number = -1;
  return i < fields.size() && absl::SimpleAtoi(fields[i], &number) ? number : -1;
}

// Returns the line of index.noun that begins with a noun, or an empty one.
absl::string_view LineOf(absl::string_view index, absl::string_view noun) {
  // [low, high) has the start of the line, if there is one.
  size_t low = 0, high = index.size();
  while (low < high) {
    const size_t middle = low + (high - low) / 2;
    const size_t before = middle == 0 ? absl::string_view::npos : index.rfind('\n', middle - 1);
    const size_t start = before == absl::string_view::npos ? 0 : before + 1;
    const size_t end = std::min(index.find('\n', middle), index.size());
    const absl::string_view line = index.substr(start, end - start);
    // The licence in front begins with spaces, which sort before every noun.
    const absl::string_view at = line.substr(0, line.find(' '));
    if (at == noun && !at.empty()) return line;
    if (at < noun) {
      low = end + 1;
    } else {
      high = start;
    }
  }
  return {};
}

// Returns the places in data.noun of the most frequent meanings that a line of index.noun lists:
//   noun pos num_meanings num_pointers pointer... num_senses num_tagged offset...
std::vector<int64_t> MeaningsOf(absl::string_view line) {
  const Fields fields = FieldsOf(line);
  const int64_t count = NumberAt(fields, 2), pointers = NumberAt(fields, 3);
  std::vector<int64_t> offsets;
  if (count < 0 || pointers < 0) return offsets;
  const size_t first = 6 + static_cast<size_t>(pointers);
  for (size_t i = first; i < fields.size() && offsets.size() < kMostMeanings; ++i) {
    const int64_t offset = NumberAt(fields, i);
    if (offset >= 0) offsets.push_back(offset);
  }
  return offsets;
}

// Returns the nouns of a line of data.noun, whose count is hexadecimal:
//   offset file type num_words word lex_id word lex_id ...
std::vector<std::string> NounsOf(absl::string_view line) {
  const Fields fields = FieldsOf(line);
  std::vector<std::string> nouns;
  uint32_t count = 0;
  if (fields.size() < 4 || !absl::SimpleHexAtoi(fields[3], &count)) return nouns;
  for (size_t k = 0; k < count && 4 + 2 * k < fields.size(); ++k) {
    nouns.push_back(absl::AsciiStrToLower(absl::StrReplaceAll(fields[4 + 2 * k], {{"_", " "}})));
  }
  return nouns;
}

}  // namespace

absl::StatusOr<std::unique_ptr<const WordNet>> WordNet::Open(const std::filesystem::path& folder) {
  const std::filesystem::path data = folder / "data.noun";
  RETURN_IF_ERROR(FileSize(data, data.string()).status());
  const std::filesystem::path index = folder / "index.noun";
  ASSIGN_OR_RETURN(std::string bytes, ReadFile(index, index.string(), kMaxIndexBytes));
  return absl::WrapUnique(new const WordNet(std::move(bytes), data));
}

std::vector<std::string> WordNet::SynonymsOf(const std::string& noun) const {
  const std::string key = absl::AsciiStrToLower(absl::StrReplaceAll(noun, {{" ", "_"}}));
  std::vector<std::string> synonyms;
  std::ifstream data(data_, std::ios::binary);
  for (const int64_t offset : MeaningsOf(LineOf(index_, key))) {
    std::string line;
    data.clear();
    if (!data.seekg(offset) || !std::getline(data, line)) continue;
    for (std::string& word : NounsOf(line)) {
      const bool known = std::ranges::find(synonyms, word) != synonyms.end();
      if (!known && word != noun) synonyms.push_back(std::move(word));
    }
  }
  return synonyms;
}

}  // namespace pepeseg
