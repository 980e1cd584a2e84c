#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg {

// The files of a network that a script of deploy/ has installed in a folder, with their digests in
// SHA256SUMS, in the format of sha256sum.
struct InstalledFiles {
  const char* what;                    // in messages: "SAM"
  const char* script;                  // "deploy/sam.sh"
  std::span<const char* const> names;  // of the files
};

// Returns the digests of the files by name. Returns NOT_FOUND when the folder or its SHA256SUMS
// does not exist: nothing is installed. Returns FAILED_PRECONDITION, with the file and the remedy,
// when a file has no line.
absl::StatusOr<std::map<std::string, std::string>> ReadInstalledDigests(
    const InstalledFiles& files, const std::filesystem::path& folder);

// Compares the files with their digests. Returns the errors of ReadInstalledDigests, and
// FAILED_PRECONDITION when a file is missing or differs. Reads all of them.
absl::Status CheckInstalledFiles(const InstalledFiles& files, const std::filesystem::path& folder);

}  // namespace pepeseg
