#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg {

// What COLMAP's feature_extractor, its matchers and its mapper tell of themselves, line by line.
class ColmapProgress {
 public:
  explicit ColmapProgress(int64_t num_photographs) : num_photographs_(num_photographs) {}

  void Read(absl::string_view line);

  // Each photograph is three steps: its features, its matches, its registration. Never falls.
  int64_t step() const { return step_; }
  int64_t num_steps() const { return 3 * num_photographs_; }

  // Of the photographs that were read, by COLMAP's names.
  const std::map<std::string, int64_t>& num_features() const { return num_features_; }
  // Photographs that match another one; -1: the mapper has not said yet.
  int64_t num_connected() const { return num_connected_; }

 private:
  void ReachShare(int part, int64_t done, int64_t of);

  int64_t num_photographs_;
  int64_t step_ = 0;
  std::string name_;  // of the photograph that is told of
  std::map<std::string, int64_t> num_features_;
  int64_t num_connected_ = -1;
};

}  // namespace pepeseg
