#pragma once

#include <string>
#include <vector>

#include "core/dataset/dataset_index.h"
#include "tests/system/fuzz/memory_file.h"

namespace pepeseg::fuzz {

// A dataset of three photographs, a.jpg, b.jpg and sub/c.png, with a file of poses.
class PoseIndex {
 public:
  explicit PoseIndex(const std::string& poses);

  // Imports the dataset with these bytes in the file of poses.
  const DatasetIndex& Put(absl::string_view bytes);

 private:
  MemoryFile photo_, poses_;
  std::vector<DatasetFile> files_;
  DatasetIndex index_;
};

}  // namespace pepeseg::fuzz
