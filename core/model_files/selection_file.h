#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// Writes a selection as a file, atomically. Its format, little-endian without padding:
//   char[8]   "PPSGSELE"
//   uint32    version, 1
//   uint32    0
//   uint64    num_gaussians of the model, at most 50,000,000
//   uint8     bits[(num_gaussians + 7) / 8]: bit i % 8 of byte i / 8 is 1 if Gaussian i is a
//   member;
//             unused bits of the last byte are 0
//   char[64]  SHA-256 of all bytes before, lower-case hexadecimal
absl::Status WriteSelectionFile(const std::filesystem::path& path, const GaussianSet& set);

// Reads such a file. DATA_LOSS, naming `name`: there is no such file, it is malformed or of another
// version, or its checksum is wrong.
absl::StatusOr<GaussianSet> ReadSelectionFile(const std::filesystem::path& path,
                                              const std::string& name);

}  // namespace pepeseg
