#include "server/data/blob_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr size_t kDigestLength = 64;
constexpr char kLengthSuffix[] = ".length";

// Creates a folder and its missing parents durably. Other processes may create the same folders, or
// remove empty ones, at the same time.
absl::Status MakeFolders(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return absl::OkStatus();
  RETURN_IF_ERROR(MakeFolders(folder.parent_path()));
  fs::create_directory(folder, error);
  if (error) return FileError(folder, "cannot make the folder", error.value());
  return SyncFolder(folder.parent_path());
}

// Creates the 256 folders for a project's blobs with one sync.
absl::Status MakeBlobFolders(const fs::path& data, const std::string& project) {
  const fs::path folder = BlobFolderOf(data, project);
  RETURN_IF_ERROR(MakeFolders(folder));
  // All at once: making each folder when it is first needed would cost a sync each time.
  for (int prefix = 0; prefix < 256; ++prefix) {
    const fs::path path = folder / absl::StrCat(absl::Hex(prefix, absl::kZeroPad2));
    std::error_code error;
    fs::create_directory(path, error);
    if (error) return FileError(path, "cannot make the folder", error.value());
  }
  return SyncFolder(folder);
}

// An open blob; the descriptor is negative if it could not be opened.
class OpenBlob {
 public:
  explicit OpenBlob(const fs::path& path)
      : descriptor_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW)) {}
  ~OpenBlob() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  OpenBlob(const OpenBlob&) = delete;
  OpenBlob& operator=(const OpenBlob&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  const int descriptor_;
};

absl::StatusOr<std::string> HashBlob(const fs::path& path, int descriptor,
                                     const std::atomic<bool>& cancel) {
  Sha256 digest;
  std::vector<char> block(size_t{1} << 20);
  while (true) {
    if (cancel) return absl::CancelledError("the server stops");
    const ssize_t got = read(descriptor, block.data(), block.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return FileError(path, "cannot read", errno);
    if (got == 0) return digest.Hex();
    digest.Add(std::string_view(block.data(), static_cast<size_t>(got)));
  }
}

// Returns whether the open file is the one that has this path now.
bool IsOpenFile(const fs::path& path, int descriptor) {
  struct stat opened {};
  struct stat named {};
  return fstat(descriptor, &opened) == 0 && lstat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

}  // namespace

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(const fs::path& data) {
  RETURN_IF_ERROR(MakeFolders(BlobFolder(data)));
  RETURN_IF_ERROR(MakeFolders(PartialFolder(data)));
  RETURN_IF_ERROR(MakeFolders(BlobLockPath(data, "").parent_path()));
  return std::unique_ptr<BlobStore>(new BlobStore(data));
}

bool BlobStore::Has(const BlobName& blob, int64_t size) const {
  std::error_code error;
  const auto found = fs::file_size(Path(blob), error);
  // A blob has its name only after its digest was verified, so the size suffices here; Verify reads
  // the bytes.
  return !error && static_cast<int64_t>(found) == size;
}

absl::Status BlobStore::Verify(const BlobName& blob, const std::atomic<bool>& cancel) const {
  const fs::path path = Path(blob);
  const OpenBlob file(path);
  if (file.descriptor() < 0 && errno == ENOENT) return absl::DataLossError("is not stored");
  if (file.descriptor() < 0) return FileError(path, "cannot open", errno);
  ASSIGN_OR_RETURN(const std::string found, HashBlob(path, file.descriptor(), cancel));
  // Read without the lock, which an upload would wait for; SetAside takes it and looks again.
  if (found == blob.sha256) return absl::OkStatus();
  RETURN_IF_ERROR(SetAside(blob, file.descriptor()));
  return absl::DataLossError(absl::StrCat("has the SHA-256 ", found));
}

// Moves a blob to damaged/. `descriptor`: the file that was found damaged. Does nothing if another
// upload has replaced the blob meanwhile.
absl::Status BlobStore::SetAside(const BlobName& blob, int descriptor) const {
  const fs::path path = Path(blob), aside = DamagedPath(data_, blob);
  RETURN_IF_ERROR(MakeFolders(aside.parent_path()));
  ASSIGN_OR_RETURN(const LockedFile alone,
                   LockedFile::WaitAlone(BlobLockPath(data_, blob.project)));
  if (!IsOpenFile(path, descriptor)) return absl::OkStatus();
  std::error_code error;
  fs::rename(path, aside, error);
  if (error) return FileError(path, "cannot move to the damaged blobs", error.value());
  futimens(descriptor, nullptr);  // now, since the collector removes it by its age
  RETURN_IF_ERROR(SyncFolder(aside.parent_path()));
  return SyncFolder(path.parent_path());
}

absl::StatusOr<LockedFile> BlobStore::Hold(const std::string& project) const {
  return LockedFile::WaitShared(BlobLockPath(data_, project));
}

absl::StatusOr<LockedFile> BlobStore::HoldAlone(const std::string& project) const {
  return LockedFile::WaitAlone(BlobLockPath(data_, project));
}

bool BlobStore::Remove(const BlobName& blob) const {
  std::error_code error;
  fs::remove(Path(blob), error);
  return !error;  // none if there is no such file
}

std::map<std::string, int64_t> BlobStore::ListPartial(const UploadName& upload) const {
  std::map<std::string, int64_t> partial;
  std::error_code error;
  for (fs::directory_iterator entry(PartialFolderOf(data_, upload), error), end;
       !error && entry != end; entry.increment(error)) {
    fs::path path = entry->path();
    // The length file says how many bytes are durable. A partial file without one starts from 0.
    if (path.extension() != kLengthSuffix) continue;
    path.replace_extension();
    const int64_t committed = CommittedBytes(path);
    if (committed > 0) partial[path.filename().string()] = committed;
  }
  return partial;
}

// Looks for the blob twice: before taking the lock of the partial file, which would create it, and
// again once it is locked, since another writer may have published the blob in between.
absl::StatusOr<std::shared_ptr<BlobWriter>> BlobStore::Begin(const UploadName& upload,
                                                             const std::string& sha256,
                                                             int64_t size) {
  const BlobName blob{upload.scene.project, sha256};
  if (Has(blob, size)) return nullptr;
  const fs::path folder = PartialFolderOf(data_, upload);
  RETURN_IF_ERROR(MakeFolders(folder));
  std::error_code unknown;
  if (!fs::is_directory(Path(blob).parent_path(), unknown)) {
    RETURN_IF_ERROR(MakeBlobFolders(data_, upload.scene.project));
  }
  absl::StatusOr<LockedFile> file = LockedFile::TryAlone(folder / sha256);
  if (absl::IsNotFound(file.status())) {  // the collector has removed the empty folder
    RETURN_IF_ERROR(MakeFolders(folder));
    file = LockedFile::TryAlone(folder / sha256);
  }
  RETURN_IF_ERROR(file.status());
  if (Has(blob, size)) {  // the previous writer has just published it
    std::error_code ignored;
    fs::remove(folder / sha256, ignored);
    return nullptr;
  }
  return std::make_shared<BlobWriter>(
      *std::move(file), BlobWriter::Target{folder / sha256, Path(blob), sha256, size});
}

void BlobStore::RemovePartial(const UploadName& upload) const {
  std::error_code ignored;
  const fs::path folder = PartialFolderOf(data_, upload);
  std::vector<fs::path> files;
  for (fs::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    if (entry->path().filename().string().size() == kDigestLength) files.push_back(entry->path());
  }
  for (const fs::path& file : files) {
    const absl::StatusOr<LockedFile> locked = LockedFile::TryAlone(file);
    // A stream is writing it. It finds the upload deleted and removes the file when it closes.
    if (!locked.ok()) continue;
    fs::remove(LengthPath(file), ignored);
    fs::remove(file, ignored);
  }
  fs::remove(folder, ignored);  // fails unless it is empty
}

absl::StatusOr<int64_t> BlobStore::FreeBytes() const {
  std::error_code error;
  const fs::space_info space = fs::space(data_, error);
  if (error) return FileError(data_, "cannot read its free space", error.value());
  return static_cast<int64_t>(space.available);
}

}  // namespace pepeseg
