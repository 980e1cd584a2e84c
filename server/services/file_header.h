#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "server/store/rows.h"

namespace pepeseg {

// Returns whether ReadFileHeader reads anything of files of this kind: photographs, points,
// Gaussians.
bool HasHeader(const DatasetFileRow& file);

// Fills in what the header of a stored file says, and that it was read: width and height of a
// photograph, or the number of points of a PLY file or of COLMAP's points3D. Reads at most 1 MiB of
// the file and decodes nothing. A header that is refused is not an error: `file.header` says so,
// and RefusalOf returns why. INTERNAL or NOT_FOUND: the file cannot be read.
absl::Status ReadFileHeader(const std::filesystem::path& blob, DatasetFileRow& file);

// Reads the header of a refused photograph again and returns INVALID_ARGUMENT with its name and the
// reason.
absl::Status RefusalOf(const std::filesystem::path& blob, const DatasetFileRow& file);

}  // namespace pepeseg
