#pragma once

#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/find/word_votes.h"
#include "server/services/recent_answers.h"
#include "server/services/text_sightings.h"
#include "server/services/word_photographs.h"
#include "server/services/word_source.h"
#include "server/worker_protocol/text_task.h"

namespace pepeseg {

// Asks the operator's program (pepesegd --text-command, text_task.h) what a text names in the
// photographs of a model's views. The program runs in a process of its own, under the limits and in
// the sandbox of a job; how it ends concerns one request only. Its answers to the most recent texts
// are kept. One program runs at a time. Thread safe.
class TextCommand final : public WordSource {
 public:
  // Most bytes that the program may write for one text.
  static constexpr int64_t kMaxOutputBytes = int64_t{1} << 30;

  // All must outlive it.
  struct Dependencies {
    TextTask task;  // for all texts; folder and text are empty. No program: the server has none
    std::filesystem::path worker;   // the pepeseg-worker program
    std::filesystem::path scratch;  // folder below which a run has its own, while it lasts
    const WordPhotographs& photographs;
  };
  explicit TextCommand(const Dependencies& deps);

  v1::FindSegmentsResponse::Source source() const override {
    return v1::FindSegmentsResponse::SOURCE_TEXT_COMMAND;
  }
  // Scores are those of the program times the IoU of what it found and the segment: half of what a
  // sure program gives a well segmented thing.
  double min_score() const override { return 0.25; }
  // Errors: those of the query's functions. FAILED_PRECONDITION: the program failed, wrote
  // something else than text_task.h says or too much, or exceeded its time; its output is in the
  // log.
  absl::StatusOr<WordAnswer> Find(const WordQuery& query) override;

 private:
  using Words = std::vector<SegmentWord>;
  class Run;

  absl::StatusOr<Words> Ask(const WordQuery& query, const SceneSegments& scene) const;

  const Dependencies deps_;
  std::mutex mutex_;
  RecentAnswers<Words> recent_;  // by model and text; guarded by mutex_
};

}  // namespace pepeseg
