#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

inline constexpr char kManifestName[] = "manifest.json";

struct ManifestEntry {
  std::string name;  // of a file directly in the manifest's folder
  int64_t size = 0;  // bytes
  std::string sha256;
};

// What a finished artifact consists of. Written last: a folder without a manifest is unfinished,
// and a file that it does not list is not there for readers. On disk, manifest.json:
//   {"version": 1, "files": [{"name": "...", "size": 123, "sha256": "..."}]}
struct Manifest {
  std::vector<ManifestEntry> files;

  bool Lists(absl::string_view name) const;
  int64_t TotalBytes() const;
};

// Measures the named files of the folder.
absl::StatusOr<Manifest> BuildManifest(const std::filesystem::path& folder,
                                       std::span<const std::string> names);

absl::Status WriteManifest(const std::filesystem::path& folder, const Manifest& manifest);

// NOT_FOUND: there is none. DATA_LOSS: it cannot be understood.
absl::StatusOr<Manifest> ReadManifest(const std::filesystem::path& folder);

// DATA_LOSS, naming the file, when one is missing or its size or checksum differs.
absl::Status VerifyManifest(const std::filesystem::path& folder, const Manifest& manifest);

}  // namespace pepeseg
