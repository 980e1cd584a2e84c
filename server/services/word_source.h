#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/find/scene_segments.h"
#include "pepeseg/v1/find.pb.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// A text that is looked up in a model.
struct WordQuery {
  const ResidentModel& model;
  std::string text;  // 1 to 200 characters
  // Returns the segments of the model, seen in views. Takes seconds for the first query of a model,
  // so a source that does not know the text should not call it.
  std::function<absl::StatusOr<std::shared_ptr<const SceneSegments>>()> segments;
  WantedCheck check;  // called before each view
};

// What a source of words knows about a text.
struct WordAnswer {
  struct Thing {
    double score = 0;      // [0, 1]
    std::string word;      // the known word that names it
    int32_t segment = -1;  // number of the segment (SceneSegments); -1: none is like it
    std::string label;     // resource name; empty: not a label's
  };
  // Things that the text may mean, in any order, with those of low scores: who asked leaves out
  // those below its minimum. Empty: the source does not know the text, or does not see such a
  // thing.
  std::vector<Thing> things;
  std::vector<std::string> known_words;  // of the source, for this model; may be empty
};

// Knows words, and finds in a model what they mean. Sources are tried in order; the first one that
// has a thing of the minimum score answers. Thread safe.
class WordSource {
 public:
  virtual ~WordSource() = default;

  virtual v1::FindSegmentsResponse::Source source() const = 0;
  // Returns the minimum score of a result where the request names none, in [0, 1]: below it the
  // source is unsure.
  virtual double min_score() const = 0;
  // Looks a text up. Errors end the request: a source that is not there has no things.
  virtual absl::StatusOr<WordAnswer> Find(const WordQuery& query) = 0;
};

}  // namespace pepeseg
