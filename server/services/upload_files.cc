#include "server/services/upload_files.h"

#include <linux/magic.h>
#include <sys/statfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <set>
#include <utility>

#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/services/file_header.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxGroupFiles = 128;  // each keeps a descriptor open
constexpr int64_t kMaxBytes = int64_t{32} << 20;
constexpr absl::Duration kMaxAge = absl::Seconds(1);
// From this number of files on, one sync of the file system takes less time than a sync of each
// file. It also waits for bytes that other programs have written, so it is not used for fewer
// files.
constexpr size_t kManyFiles = 16;

// Returns whether syncfs reports that bytes were lost: since Linux 5.8 it does.
bool KernelReportsErrors() {
  utsname name{};
  int major = 0;
  int minor = 0;
  if (uname(&name) != 0 || std::sscanf(name.release, "%d.%d", &major, &minor) != 2) return false;
  return major > 5 || (major == 5 && minor >= 8);
}

// Returns whether syncfs does for all files what fsync does for one. Local file systems that are
// known to do so are listed; those in user space and on networks may not.
bool SyncsAsAWhole(int descriptor) {
  static const bool reports = KernelReportsErrors();
  constexpr int64_t kXfs = 0x58465342;
  struct statfs system {};
  if (!reports || fstatfs(descriptor, &system) != 0) return false;
  const auto type = static_cast<int64_t>(system.f_type);
  return type == EXT4_SUPER_MAGIC || type == kXfs || type == BTRFS_SUPER_MAGIC ||
         type == TMPFS_MAGIC;
}

// Syncs the folders of the blobs, which makes their names durable.
absl::Status SyncFolders(const std::vector<WriteGroup::File>& files) {
  std::set<fs::path> folders;
  for (const auto& file : files) {
    if (file.writer != nullptr) folders.insert(file.writer->blob().parent_path());
  }
  for (const fs::path& folder : folders) RETURN_IF_ERROR(SyncFolder(folder));
  return absl::OkStatus();
}

}  // namespace

absl::Status OfFile(const std::string& path, const absl::Status& status) {
  if (status.ok()) return status;
  const char* reason = absl::IsDataLoss(status)            ? "BYTES_MISMATCH"
                       : absl::IsResourceExhausted(status) ? kDiskFull
                                                           : "BAD_FILE";
  return WithDetail(WithPrefix(path + ": ", status), {.reason = reason, .resource = path});
}

bool WriteGroup::due() const {
  return files_.size() >= kMaxGroupFiles || num_bytes_ >= kMaxBytes ||
         absl::Now() - since_ > kMaxAge;
}

bool WriteGroup::Holds(const std::string& sha256, int64_t size) const {
  return std::any_of(files_.begin(), files_.end(), [&](const File& file) {
    return file.record.sha256 == sha256 && file.record.size == size;
  });
}

void WriteGroup::Add(const UploadName& upload, File file) {
  if (files_.empty()) {
    upload_ = upload;
    since_ = absl::Now();
  }
  if (file.writer != nullptr) num_bytes_ += file.writer->size();
  files_.push_back(std::move(file));
}

absl::Status WriteGroup::Sync(const std::vector<File>& files) {
  for (const File& file : files) {
    if (file.writer != nullptr) RETURN_IF_ERROR(OfFile(file.record.path, file.writer->Sync()));
  }
  return absl::OkStatus();
}

absl::Status WriteGroup::Publish(std::vector<File>& files) {
  std::vector<int> written;
  for (const File& file : files) {
    if (file.writer != nullptr) written.push_back(file.writer->descriptor());
  }
  const bool as_a_whole = written.size() >= kManyFiles && SyncsAsAWhole(written[0]);
  // The first file was opened before any of the bytes were written, so this sync reports the loss
  // of any of them. If it fails, each file is synced by itself to find the one that is damaged.
  // First the bytes, then the names: after a crash a name must not lead to bytes that are missing.
  if (!as_a_whole || syncfs(written[0]) != 0) RETURN_IF_ERROR(Sync(files));
  for (const File& file : files) {
    if (file.writer != nullptr) RETURN_IF_ERROR(OfFile(file.record.path, file.writer->Publish()));
  }
  if (!as_a_whole || syncfs(written[0]) != 0) RETURN_IF_ERROR(SyncFolders(files));
  // Read now, while the bytes are in the page cache. A header that cannot be read is read again
  // when a training needs it.
  for (File& file : files) {
    if (file.writer != nullptr) ReadFileHeader(file.writer->blob(), file.record).IgnoreError();
  }
  return absl::OkStatus();
}

absl::Status WriteGroup::Commit(Store& store, BlobStore& blobs) {
  if (files_.empty()) return absl::OkStatus();
  // The group is emptied even if the commit fails: the stream ends then, and the client resumes by
  // GetUpload.
  std::vector<File> files = std::exchange(files_, {});
  num_bytes_ = 0;
  since_ = absl::InfiniteFuture();
  RETURN_IF_ERROR(Publish(files));
  std::vector<DatasetFileRecord> records;
  records.reserve(files.size());
  for (File& file : files) records.push_back(std::move(file.record));
  // Last, so that the database never says that a file is stored whose bytes could be lost. A crash
  // before this leaves blobs without a record, which the next CreateUpload or SealUpload finds.
  const absl::Status marked = store.files().MarkFilesStored(upload_, records);
  if (!absl::IsNotFound(marked)) return marked;
  std::vector<std::string> digests;
  for (const DatasetFileRecord& record : records) digests.push_back(record.sha256);
  // What cannot be removed now is left to the collector.
  RemoveUnnamedBlobs(store, blobs, upload_.scene.project, digests).IgnoreError();
  return marked;
}

absl::Status DeleteUpload(Store& store, BlobStore& blobs, const UploadName& upload) {
  ASSIGN_OR_RETURN(const auto files, store.files().ListDatasetFiles(upload.scene, upload.number));
  // The record first: a stream that starts now finds no upload, and one that writes finds it gone
  // when it commits.
  RETURN_IF_ERROR(store.datasets().DeleteUpload(upload.scene, upload.number));
  blobs.RemovePartial(upload);
  std::vector<std::string> digests;
  digests.reserve(files.size());
  for (const DatasetFileRecord& file : files) digests.push_back(file.sha256);
  return RemoveUnnamedBlobs(store, blobs, upload.scene.project, digests);
}

absl::Status RemoveUnnamedBlobs(Store& store, BlobStore& blobs, const std::string& project,
                                const std::vector<std::string>& digests) {
  // Uploads hold the shared lock from before they look for blobs until their records name them, so
  // what is unnamed under the exclusive lock stays so until it is removed.
  ASSIGN_OR_RETURN(const LockedFile alone, blobs.HoldAlone(project));
  ASSIGN_OR_RETURN(const std::set<std::string> named, store.files().ListDigests(project));
  std::vector<std::string> gone;
  for (const std::string& digest : digests) {
    // Only blobs that are gone leave the quota. The collector tries the others again.
    if (!named.contains(digest) && blobs.Remove({project, digest})) gone.push_back(digest);
  }
  return store.files().ForgetBlobs(project, gone);
}

}  // namespace pepeseg
