#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// One level of ground truth of a capture: its parts, say, or its objects.
struct TruthLevel {
  std::string name;
  std::vector<std::string> entities;          // names by id; empty: they have none
  std::vector<std::vector<uint16_t>> labels;  // by view, [height, width]; empty: the view has none
};

// What benches need of a scene on machines without image codecs, as one gzip file. Not a format to
// keep: it is read by the build that wrote it.
struct CapturePack {
  Capture capture;
  std::vector<TruthLevel> truth;
};
absl::Status WriteCapturePack(const std::string& path, const CapturePack& pack);
absl::StatusOr<CapturePack> ReadCapturePack(const std::string& path);

}  // namespace pepeseg
