#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "absl/strings/string_view.h"
#include "core/sfm/sfm_options.h"

namespace pepeseg {

// The progress of stage "sfm": from the output of COLMAP's feature_extractor, matchers and mapper
// (of COLMAP 3.8), line by line, and from the own matcher. Ignores lines that it does not know. Not
// thread safe.
class SfmProgress {
 public:
  // `work` is the expected work of the parts, which weighs them in share().
  SfmProgress(int64_t num_photographs, int64_t num_pairs, const SfmWork& work)
      : num_photographs_(num_photographs), num_pairs_(num_pairs), work_(work) {}

  // Reads one line of output.
  void Read(absl::string_view line);
  // Takes the number of features of a photograph that the own extraction has done, by its name in
  // COLMAP.
  void Extract(const std::string& name, int64_t num_features);
  // Takes the progress of the own matcher: `done` of `total` pairs are scored, or matched and
  // verified.
  void Score(int64_t done, int64_t total) { Reach(kChoosing, done, total); }
  void Compare(int64_t done, int64_t total);
  // Takes the share of the own mapper's work that is done.
  void Place(double share);
  // Marks the last part as complete.
  void Finish();

  // Words and numbers of "matching 19 of 60 pairs" for the part that runs. Its steps never fall,
  // and progress never returns to an earlier part. The texts are literals, empty before the first
  // part.
  std::string_view activity() const;
  std::string_view unit() const;
  int64_t step() const { return step_; }
  int64_t num_steps() const { return num_steps_; }
  // Returns the share of the expected work of all parts that is done, in [0, 1]. Never falls.
  double share() const { return share_; }

  // Number of features of each photograph that was read, by its name in COLMAP.
  const std::map<std::string, int64_t>& num_features() const { return num_features_; }
  // Number of photographs that match at least one other. -1: the mapper has not reported it yet.
  int64_t num_connected() const { return num_connected_; }

 private:
  enum Part { kNone = -1, kExtracting = 0, kChoosing = 1, kMatching = 2, kMapping = 3 };
  // Raises the progress to `done` of `of` in `part`. Does nothing if a later part has begun.
  void Reach(Part part, int64_t done, int64_t of);
  int64_t NumSteps(Part part, int64_t of) const;
  void ReadMatching(absl::string_view counts);

  int64_t num_photographs_, num_pairs_;
  SfmWork work_;
  Part part_ = kNone;
  // Unit in which matching is reported: true: pairs; false: photographs.
  bool by_pairs_ = false;
  int64_t step_ = 0, num_steps_ = 0;
  double share_ = 0;
  std::string name_;  // of the photograph that the following lines are about
  std::map<std::string, int64_t> num_features_;
  int64_t num_connected_ = -1;
};

}  // namespace pepeseg
