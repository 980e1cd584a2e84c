#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/find/word_votes.h"
#include "core/priors/detect/detector.h"
#include "server/services/recent_answers.h"
#include "server/services/word_photographs.h"
#include "server/services/word_source.h"

namespace pepeseg {

// Knows the everyday words of a detector (core/priors/detect) and finds their things in the
// photographs of a model's views. Loads the detector with the first text that needs it, and keeps
// it: its memory counts in the budget of the models. What it has found in a model is kept for the
// most recently asked models, so that each photograph is looked at once. One model is looked at at
// a time. Thread safe.
class DetectorWords final : public WordSource {
 public:
  // All must outlive it.
  struct Dependencies {
    std::filesystem::path folder;  // of the detector's files; empty: the server has none
    int num_threads = 1;
    ModelLoader& models;
    const WordPhotographs& photographs;
  };
  // Reads the words; a folder that the caller has not checked may be damaged.
  explicit DetectorWords(const Dependencies& deps);

  // Returns the number of words that the detector knows; 0: the server has none.
  size_t num_words() const { return known_.size(); }
  v1::FindSegmentsResponse::Source source() const override {
    return v1::FindSegmentsResponse::SOURCE_DETECTOR;
  }
  // Measured: tests/bench/results/words.md.
  double min_score() const override { return 0.29; }
  // Errors: those of the query's functions. FAILED_PRECONDITION: the detector cannot be loaded.
  // RESOURCE_EXHAUSTED: out of memory. UNAVAILABLE: models in use leave it no room for now.
  absl::StatusOr<WordAnswer> Find(const WordQuery& query) override;

 private:
  using Words = std::vector<SegmentWord>;

  // With mutex_ held.
  absl::Status OpenDetector();
  absl::StatusOr<const Words*> WordsOf(const WordQuery& query, const SceneSegments& scene);

  const Dependencies deps_;
  const std::vector<std::string> known_;
  std::mutex mutex_;
  std::unique_ptr<ReservedMemory> memory_;  // of the detector; guarded by mutex_, as the following
  std::unique_ptr<Detector> detector_;
  RecentAnswers<Words> recent_;  // by model
};

}  // namespace pepeseg
