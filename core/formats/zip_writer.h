#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// Makes a zip in memory. The same files give the same bytes: they have no times, and stay in the
// order in which they are added.
class ZipWriter {
 public:
  // kStored is for what is compressed already, such as PNGs.
  enum class Method { kStored, kDeflated };

  // Adds a file. The name is UTF-8, relative, with '/' between folders, and not added yet.
  // RESOURCE_EXHAUSTED: the zip would exceed 4 GiB.
  absl::Status Add(absl::string_view name, absl::string_view bytes, Method method);

  int64_t num_bytes() const { return static_cast<int64_t>(zip_.size() + directory_.size()); }
  // Returns the zip. RESOURCE_EXHAUSTED: see Add.
  absl::StatusOr<std::string> Finish() &&;

 private:
  std::string zip_;        // the files so far
  std::string directory_;  // what lists them at the end
  int64_t num_files_ = 0;
};

}  // namespace pepeseg
