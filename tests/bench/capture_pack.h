#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/capture.h"

namespace pepeseg {

// A capture as one gzip file, for benches on machines without image codecs. Not a format to keep:
// it is read by the build that wrote it.
absl::Status WriteCapturePack(const std::string& path, const Capture& capture);
absl::StatusOr<Capture> ReadCapturePack(const std::string& path);

}  // namespace pepeseg
