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
  std::string name;    // of a file in the manifest's folder, without '/'
  int64_t size = 0;    // bytes
  std::string sha256;  // 64 lower-case hexadecimal digits
};

// The list of files of a finished artifact. It is written last, so a folder without a manifest is
// unfinished. Readers ignore files that it does not list. Stored as manifest.json:
//   {"version": 1, "files": [{"name": "...", "size": 123, "sha256": "..."}]}
struct Manifest {
  std::vector<ManifestEntry> files;

  bool Lists(absl::string_view name) const;
};

// Computes size and digest of the named files of the folder. NOT_FOUND: one does not exist.
absl::StatusOr<Manifest> BuildManifest(const std::filesystem::path& folder,
                                       std::span<const std::string> names);

// Writes manifest.json atomically.
absl::Status WriteManifest(const std::filesystem::path& folder, const Manifest& manifest);

// Reads manifest.json. NOT_FOUND: there is none. DATA_LOSS: it is malformed.
absl::StatusOr<Manifest> ReadManifest(const std::filesystem::path& folder);

// Returns DATA_LOSS, naming the file, if a listed file is missing or has another size or digest.
absl::Status VerifyManifest(const std::filesystem::path& folder, const Manifest& manifest);

// Returns what the folder's manifest says of a file. DATA_LOSS: it is not listed. Other errors as
// ReadManifest.
absl::StatusOr<ManifestEntry> FindListed(const std::filesystem::path& folder,
                                         const std::string& name);

// Reads one file that the folder's manifest lists, and verifies its digest. DATA_LOSS: it is not
// listed, missing or changed. Other errors as ReadFile and ReadManifest.
absl::StatusOr<std::string> ReadListedFile(const std::filesystem::path& folder,
                                           const std::string& name, int64_t max_bytes);

}  // namespace pepeseg
