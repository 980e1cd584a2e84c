#include "core/onnx/installed_files.h"

#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr char kDigests[] = "SHA256SUMS";
constexpr int64_t kMaxDigestFile = 4096;  // bytes of SHA256SUMS

// Returns FAILED_PRECONDITION with the file, the reason and the remedy.
absl::Status Bad(const InstalledFiles& files, const std::filesystem::path& file,
                 absl::string_view what) {
  return absl::FailedPreconditionError(
      absl::StrCat(files.what, ": ", file.string(), ": ", what, "; run ", files.script, " ",
                   file.parent_path().string(), " to install it again"));
}

}  // namespace

absl::StatusOr<std::map<std::string, std::string>> ReadInstalledDigests(
    const InstalledFiles& files, const std::filesystem::path& folder) {
  const std::filesystem::path list = folder / kDigests;
  const absl::StatusOr<std::string> text = ReadFile(list, list.string(), kMaxDigestFile);
  if (absl::IsNotFound(text.status())) {
    return absl::NotFoundError(absl::StrCat(files.what, ": ", list.string(),
                                            " does not exist; run ", files.script, " ",
                                            folder.string(), " to install ", files.what, " there"));
  }
  if (!text.ok()) return Bad(files, list, text.status().message());
  std::map<std::string, std::string> digests;
  for (const absl::string_view line : absl::StrSplit(*text, '\n', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> words =
        // A line is the digest, two spaces and the name.
        absl::StrSplit(line, absl::MaxSplits("  ", 1));
    digests[words.second] = words.first;
  }
  for (const char* name : files.names) {
    if (!digests.contains(name)) return Bad(files, list, absl::StrCat("has no line for ", name));
  }
  return digests;
}

absl::Status CheckInstalledFiles(const InstalledFiles& files, const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(auto digests, ReadInstalledDigests(files, folder));
  for (const char* name : files.names) {
    const std::filesystem::path file = folder / name;
    const absl::StatusOr<std::string> digest = Sha256OfFile(file);
    if (!digest.ok()) return Bad(files, file, digest.status().message());
    if (*digest == digests[name]) continue;
    return Bad(
        files, file,
        absl::StrCat("its SHA-256 is ", *digest, ", not ", digests[name], " as in SHA256SUMS"));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
