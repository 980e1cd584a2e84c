#include "server/rpc/blob_store.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/jobs/durable_file.h"
#include "server/layout.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

absl::Status MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  return error ? FileError(folder, "cannot make the folder", error.value()) : absl::OkStatus();
}

// A name in its folder lasts once the folder is on the disk.
absl::Status SyncFolder(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return FileError(folder, "cannot open the folder", errno);
  const int error = fsync(descriptor) == 0 ? 0 : errno;
  close(descriptor);
  return error == 0 ? absl::OkStatus() : FileError(folder, "cannot sync the folder", error);
}

// Unique while the process lives; a new one starts with an empty folder.
std::string NextIncomingName() {
  static std::atomic<int64_t> next = 0;
  return absl::StrCat(next.fetch_add(1), ".part");
}

}  // namespace

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(const fs::path& data) {
  const fs::path incoming = IncomingFolder(data);
  std::error_code error;
  fs::remove_all(incoming, error);
  if (error) return FileError(incoming, "cannot clear the folder", error.value());
  RETURN_IF_ERROR(MakeFolder(incoming));
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
  auto writer = std::unique_ptr<Writer>(new Writer());
  const fs::path incoming = IncomingFolder(data_) / NextIncomingName();
  writer->descriptor_ = open(incoming.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (writer->descriptor_ < 0) return FileError(incoming, "cannot make the file", errno);
  writer->incoming_ = incoming;
  writer->target_ = Path(sha256);
  writer->sha256_ = sha256;
  writer->size_ = size;
  return writer;
}

BlobStore::Writer::~Writer() {
  if (descriptor_ >= 0) close(descriptor_);
  if (!incoming_.empty()) unlink(incoming_.c_str());
}

absl::Status BlobStore::Writer::Append(std::string_view bytes) {
  if (written_ + static_cast<int64_t>(bytes.size()) > size_) {
    return absl::InvalidArgumentError(absl::StrCat("more bytes than the ", size_,
                                                   " declared: at least ",
                                                   written_ + static_cast<int64_t>(bytes.size())));
  }
  digest_.Update(bytes);
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return FileError(incoming_, "cannot write", errno);
    written_ += count;
    bytes.remove_prefix(static_cast<size_t>(count));
  }
  return absl::OkStatus();
}

absl::Status BlobStore::Writer::Commit() {
  if (written_ != size_) {
    return absl::InvalidArgumentError(
        absl::StrCat("ended after ", written_, " of the ", size_, " bytes declared"));
  }
  const std::string found = digest_.Finish();
  if (found != sha256_) {
    return absl::DataLossError(
        absl::StrCat("the bytes have the SHA-256 ", found, ", declared was ", sha256_));
  }
  if (fsync(descriptor_) != 0) return FileError(incoming_, "cannot sync", errno);
  RETURN_IF_ERROR(MakeFolder(target_.parent_path()));
  if (rename(incoming_.c_str(), target_.c_str()) != 0) {
    return FileError(target_, "cannot rename a file to it", errno);
  }
  incoming_.clear();
  RETURN_IF_ERROR(SyncFolder(target_.parent_path()));
  return SyncFolder(target_.parent_path().parent_path());
}

}  // namespace pepeseg
