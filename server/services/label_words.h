#pragma once

#include <memory>

#include "core/find/wordnet.h"
#include "server/services/seen_models.h"
#include "server/services/word_source.h"

namespace pepeseg {

// Finds the labels of a model's scene by their texts and ids (core/find/word_match.h). A label
// whose view the model does not have is left out.
class LabelWords final : public WordSource {
 public:
  // The store must outlive it. wordnet: null: no synonyms.
  LabelWords(Store& store, std::shared_ptr<const WordNet> wordnet)
      : store_(store), wordnet_(std::move(wordnet)) {}

  v1::FindSegmentsResponse::Source source() const override {
    return v1::FindSegmentsResponse::SOURCE_LABELS;
  }
  double min_score() const override { return 0.5; }
  absl::StatusOr<WordAnswer> Find(const WordQuery& query) override;

 private:
  Store& store_;
  const std::shared_ptr<const WordNet> wordnet_;
};

}  // namespace pepeseg
