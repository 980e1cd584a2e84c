#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace pepeseg {

// The nouns of WordNet (Princeton University), read from the files that Debian's wordnet-base has
// in /usr/share/wordnet: index.noun, whose lines are sorted by noun and list the meanings of each,
// and data.noun, with the nouns of each meaning. Format: wndb(5WN). Thread safe.
class WordNet {
 public:
  // Reads index.noun, 5 MB. NOT_FOUND: a file is missing. Other errors are those of ReadFile.
  static absl::StatusOr<std::unique_ptr<const WordNet>> Open(const std::filesystem::path& folder);

  // Returns the nouns that share one of the four most frequent meanings of a noun, without
  // repeats. All are lower case; words of a phrase are separated by spaces. Empty: WordNet does not
  // have the noun, or a file is damaged.
  std::vector<std::string> SynonymsOf(const std::string& noun) const;

 private:
  WordNet(std::string index, std::filesystem::path data)
      : index_(std::move(index)), data_(std::move(data)) {}

  const std::string index_;           // the bytes of index.noun
  const std::filesystem::path data_;  // path of data.noun
};

}  // namespace pepeseg
