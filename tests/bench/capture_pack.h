#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// One level of ground truth of a capture, for example its parts or its objects.
struct TruthLevel {
  std::string name;
  std::vector<std::string> entities;  // names by id; empty: the entities have no names
  std::vector<std::vector<uint16_t>>
      labels;  // by view, [height, width]; empty: the view has no labels
};

// A scene as one gzip file, or the same bytes without compression, for benches on machines without
// image codecs. Not a stable format: only the build that wrote a file can read it.
struct CapturePack {
  Capture capture;
  std::vector<TruthLevel> truth;
};
absl::Status WriteCapturePack(const std::string& path, const CapturePack& pack,
                              bool compressed = true);
absl::StatusOr<CapturePack> ReadCapturePack(const std::string& path);

}  // namespace pepeseg
