#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// A selection on disk, little-endian, without padding:
//   char[8]   "PPSGSELE"
//   uint32    version, 1
//   uint32    0
//   uint64    num_gaussians of the model, at most 50,000,000
//   uint8     bits[(num_gaussians + 7) / 8]: bit i % 8 of byte i / 8 is Gaussian i's, the bits
//             beyond the last one are 0
//   char[64]  SHA-256 of all bytes before, lower-case hexadecimal
// Written atomically.
absl::Status WriteSelectionFile(const std::filesystem::path& path, const GaussianSet& set);

// DATA_LOSS with `name`: there is no such file, its checksum fails, or it is of another version.
absl::StatusOr<GaussianSet> ReadSelectionFile(const std::filesystem::path& path,
                                              const std::string& name);

}  // namespace pepeseg
