#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::fuzz {

// A file in memory, for readers that take a path. The path is valid as long as the object.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // Replaces the content by the bytes, and returns the path.
  const std::string& Put(absl::string_view bytes);

 private:
  int descriptor_;
  std::string path_;
};

}  // namespace pepeseg::fuzz
