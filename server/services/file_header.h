#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "server/store/rows.h"

namespace pepeseg {

// Whether ReadFileHeader keeps anything of files of this kind: photographs, points and Gaussians.
bool HasHeader(const DatasetFileRow& file);

// Fills in what the header of a stored file says, and that it was read: width and height of a
// photograph, the number of points of a PLY file or of COLMAP's points3D. Reads at most 1 MiB of
// the file, whatever its size, and decodes nothing. A header that is refused is not an error here:
// file.header says so, and RefusalOf why. INTERNAL or NOT_FOUND: the file cannot be read.
absl::Status ReadFileHeader(const std::filesystem::path& blob, DatasetFileRow& file);

// INVALID_ARGUMENT with the name of a photograph whose header was refused, and the reason, which is
// read again.
absl::Status RefusalOf(const std::filesystem::path& blob, const DatasetFileRow& file);

}  // namespace pepeseg
