#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "absl/strings/string_view.h"
#include "core/sfm/sfm_work.h"

namespace pepeseg {

// Progress of COLMAP's feature_extractor, matchers and mapper, read from their output line by line.
class ColmapProgress {
 public:
  // `work`: expected work of the three parts, which weighs them in share().
  ColmapProgress(int64_t num_photographs, int64_t num_pairs, const SfmWork& work)
      : num_photographs_(num_photographs), num_pairs_(num_pairs), work_(work) {}

  void Read(absl::string_view line);
  // The last part is over.
  void Finish();

  // The part that runs, as in "matching 19 of 60 pairs". Its steps never fall, and no earlier part
  // comes back. The texts are literals, empty before the first part.
  std::string_view activity() const;
  std::string_view unit() const;
  int64_t step() const { return step_; }
  int64_t num_steps() const { return num_steps_; }
  // Of the expected work of all parts, [0, 1]. Never falls.
  double share() const;

  // Of the photographs that were read, by COLMAP's names.
  const std::map<std::string, int64_t>& num_features() const { return num_features_; }
  // Photographs that match another one; -1: the mapper has not said yet.
  int64_t num_connected() const { return num_connected_; }

 private:
  enum Part { kNone = -1, kExtracting = 0, kMatching = 1, kMapping = 2 };
  void Reach(Part part, int64_t done, int64_t of);
  void ReadMatching(absl::string_view counts);

  int64_t num_photographs_, num_pairs_;
  SfmWork work_;
  Part part_ = kNone;
  bool by_blocks_ =
      false;  // matching: all pairs, told block by block; else photograph by photograph
  int64_t step_ = 0, num_steps_ = 0;
  std::string name_;  // of the photograph that is told of
  std::map<std::string, int64_t> num_features_;
  int64_t num_connected_ = -1;
};

}  // namespace pepeseg
