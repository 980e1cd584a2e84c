#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::fuzz {

// A file in memory, for readers that take a path. Its path holds as long as it lives.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // The path of the file, which now holds the bytes.
  const std::string& Put(absl::string_view bytes);

 private:
  int descriptor_;
  std::string path_;
};

}  // namespace pepeseg::fuzz
