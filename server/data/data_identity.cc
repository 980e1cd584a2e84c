#include "server/data/data_identity.h"

#include <random>
#include <string>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxFileBytes = 1000;

std::string RandomIdentity() {
  std::random_device random;
  std::string id;
  for (int i = 0; i < 4; ++i) absl::StrAppendFormat(&id, "%08x", random());
  return id;
}

}  // namespace

absl::Status CheckIdentity(Store& store, const std::filesystem::path& data) {
  // Held until the check is over, so that of several servers one makes the identity.
  ASSIGN_OR_RETURN(const LockedFile lock, LockedFile::WaitAlone(data / "database-id.lock"));
  const std::filesystem::path path = IdentityPath(data);
  std::string of_folder;
  if (std::filesystem::exists(path)) {
    ASSIGN_OR_RETURN(of_folder, ReadFile(path, path.string(), kMaxFileBytes));
  }
  absl::StripAsciiWhitespace(&of_folder);
  ASSIGN_OR_RETURN(const std::string of_database, store.Identity());
  if (of_folder.empty() && of_database.empty()) {
    const std::string id = RandomIdentity();
    RETURN_IF_ERROR(WriteFileAtomically(path, id + "\n"));
    return store.SetIdentity(id);
  }
  if (of_folder == of_database) return absl::OkStatus();
  const std::string remedy =
      of_database.empty() ? absl::StrCat("remove ", path.string())
                          : absl::StrCat("write the line ", of_database, " to ", path.string());
  return absl::FailedPreconditionError(
      absl::StrCat(data.string(), ": this data directory does not belong to the database; check ",
                   "--data and --database. If they belong together, as after a restore: ", remedy));
}

}  // namespace pepeseg
