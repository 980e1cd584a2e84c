#include "core/priors/sam/sam_files.h"

#include <map>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/digest.h"
#include "core/base/file_bytes.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxDigestFile = 4096;  // bytes of SHA256SUMS

// Returns FAILED_PRECONDITION with the file, the reason and the remedy.
absl::Status Bad(const std::filesystem::path& file, absl::string_view what) {
  return absl::FailedPreconditionError(
      absl::StrCat("SAM: ", file.string(), ": ", what, "; run deploy/sam.sh ",
                   file.parent_path().string(), " to install it again"));
}

}  // namespace

// A missing SHA256SUMS means that SAM is not installed; everything else that is wrong means that
// the installation is damaged.
absl::Status CheckSamFiles(const std::filesystem::path& folder) {
  const std::filesystem::path list = folder / kSamDigests;
  const absl::StatusOr<std::string> text = ReadFile(list, list.string(), kMaxDigestFile);
  if (absl::IsNotFound(text.status())) {
    return absl::NotFoundError(absl::StrCat("SAM: ", list.string(),
                                            " does not exist; run deploy/sam.sh ", folder.string(),
                                            " to install SAM there"));
  }
  if (!text.ok()) return Bad(list, text.status().message());
  std::map<std::string, std::string> digests;
  for (const absl::string_view line : absl::StrSplit(*text, '\n', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> words =
        // The format of sha256sum: the digest, two spaces, the name.
        absl::StrSplit(line, absl::MaxSplits("  ", 1));
    digests[words.second] = words.first;
  }
  for (const char* name : {kSamEncoder, kSamDecoder, kSamRuntime}) {
    const std::filesystem::path file = folder / name;
    if (!digests.contains(name)) return Bad(list, absl::StrCat("has no line for ", name));
    const absl::StatusOr<std::string> digest = Sha256OfFile(file);
    if (!digest.ok()) return Bad(file, digest.status().message());
    if (*digest == digests[name]) continue;
    return Bad(file, absl::StrCat("its SHA-256 is ", *digest, ", not ", digests[name],
                                  " as in SHA256SUMS"));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
