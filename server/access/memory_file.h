#pragma once

#include <ctime>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// A text that code of this process reads as a file while it never comes to a disk. A reader sees
// one text or the other, never some of both; and each has a time of modification of its own, in
// seconds, so that who looks at that before and after reading knows.
class MemoryFile {
 public:
  MemoryFile() = default;
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  // INTERNAL: the system has no memory or no descriptor for it; the old text stays.
  absl::Status Replace(const std::string& text);
  // The same for all its texts; once there is one.
  std::string path() const;

 private:
  int descriptor_ = -1;
  time_t next_time_ = 1'000'000'000;  // any, but not 0
};

}  // namespace pepeseg
