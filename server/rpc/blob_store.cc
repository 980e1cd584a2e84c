#include "server/rpc/blob_store.h"

#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/file_error.h"
#include "server/layout.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr size_t kDigestLength = 64;

// Files of other names than a digest's were never finished.
absl::Status ClearUnfinished(const fs::path& blobs) {
  std::error_code error;
  std::vector<fs::path> unfinished;
  for (auto entry = fs::recursive_directory_iterator(blobs, error);
       !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    const bool whole = entry->path().filename().string().size() == kDigestLength;
    if (!whole && entry->is_regular_file(error)) unfinished.push_back(entry->path());
  }
  for (const fs::path& path : unfinished) {
    if (!error) fs::remove(path, error);
  }
  return error ? FileError(blobs, "cannot clear the folder", error.value()) : absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(const fs::path& data) {
  const fs::path blobs = BlobFolder(data);
  std::error_code error;
  fs::create_directories(blobs, error);
  if (error) return FileError(blobs, "cannot make the folder", error.value());
  RETURN_IF_ERROR(ClearUnfinished(blobs));
  return std::unique_ptr<BlobStore>(new BlobStore(data));
}

bool BlobStore::Has(const std::string& sha256, int64_t size) const {
  std::error_code error;
  const auto found = fs::file_size(Path(sha256), error);
  return !error && static_cast<int64_t>(found) == size;
}

fs::path BlobStore::Path(const std::string& sha256) const { return BlobPath(data_, sha256); }

absl::StatusOr<std::unique_ptr<BlobStore::Writer>> BlobStore::Begin(const std::string& sha256,
                                                                    int64_t size) {
  const fs::path target = Path(sha256);
  std::error_code error;
  if (fs::create_directory(target.parent_path(), error)) {
    RETURN_IF_ERROR(SyncFolder(BlobFolder(data_)));
  }
  if (error) return FileError(target.parent_path(), "cannot make the folder", error.value());
  ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(target));
  return std::unique_ptr<Writer>(new Writer(std::move(file), sha256, size));
}

absl::Status BlobStore::Writer::Append(std::string_view bytes) {
  written_ += static_cast<int64_t>(bytes.size());
  if (written_ > size_) {
    return absl::InvalidArgumentError(
        absl::StrCat("more bytes than the ", size_, " declared: at least ", written_));
  }
  digest_.Add(bytes);
  return file_.Append(bytes);
}

absl::Status BlobStore::Writer::Commit() {
  if (written_ != size_) {
    return absl::InvalidArgumentError(
        absl::StrCat("ended after ", written_, " of the ", size_, " bytes declared"));
  }
  const std::string found = digest_.Hex();
  if (found != sha256_) {
    return absl::DataLossError(
        absl::StrCat("the bytes have the SHA-256 ", found, ", declared was ", sha256_));
  }
  return file_.Commit();
}

}  // namespace pepeseg
