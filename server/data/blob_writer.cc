#include "server/data/blob_writer.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// Bytes after which the partial file is synced and its length recorded: what a power cut can cost a
// client.
constexpr int64_t kCommitBytes = int64_t{32} << 20;
// Bytes hashed per task, so that a 4 GiB file does not monopolise a pool thread.
constexpr int64_t kRehashBytes = int64_t{64} << 20;
constexpr size_t kReadBytes = size_t{1} << 20;

}  // namespace

// A length beyond the file's end is not valid: the file was begun again from scratch, or its bytes
// were lost with the disk's cache.
int64_t CommittedBytes(const fs::path& partial) {
  int64_t length = 0;
  std::ifstream(LengthPath(partial)) >> length;
  std::error_code error;
  const auto there = static_cast<int64_t>(fs::file_size(partial, error));
  return !error && length > 0 && length <= there ? length : 0;
}

BlobWriter::BlobWriter(LockedFile file, Target target)
    : file_(std::move(file)),
      target_(std::move(target)),
      committed_(CommittedBytes(target_.partial)) {}

// Commits what is written. Errors are ignored: the one that ended the upload was reported already,
// and a client sends again what could not be committed.
BlobWriter::~BlobWriter() {
  if (ended_) return;
  if (written_ > committed_) Record().IgnoreError();
  if (committed_ == 0) Discard().IgnoreError();
}

absl::Status BlobWriter::Start(int64_t offset) {
  if (offset != 0 && offset != committed_) {
    return absl::OutOfRangeError(
        absl::StrCat("the offset is ", offset, ", committed are ", committed_, " bytes"));
  }
  // Remove the old length first, durably: it must not be taken for that of the new bytes.
  std::error_code error;
  if (offset == 0 && fs::remove(LengthPath(target_.partial), error)) {
    RETURN_IF_ERROR(SyncFolder(target_.partial.parent_path()));
  }
  if (error) return FileError(LengthPath(target_.partial), "cannot remove", error.value());
  // Bytes beyond the recorded length may never have reached the disk.
  if (ftruncate(file_.descriptor(), offset) != 0) {
    return FileError(target_.partial, "cannot shorten", errno);
  }
  if (lseek(file_.descriptor(), offset, SEEK_SET) != offset) {
    return FileError(target_.partial, "cannot seek", errno);
  }
  committed_ = offset;
  written_ = offset;
  return absl::OkStatus();
}

// Reads what an earlier writer committed: SHA-256 cannot be resumed from a digest, and its state is
// not stored.
absl::Status BlobWriter::Rehash() {
  std::vector<char> block(kReadBytes);
  const int64_t end = std::min(written_, hashed_ + kRehashBytes);
  while (hashed_ < end) {
    const auto want = std::min<size_t>(block.size(), static_cast<size_t>(end - hashed_));
    const ssize_t got = pread(file_.descriptor(), block.data(), want, hashed_);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return FileError(target_.partial, "cannot read", got < 0 ? errno : EIO);
    digest_.Add(std::string_view(block.data(), static_cast<size_t>(got)));
    hashed_ += got;
  }
  return absl::OkStatus();
}

absl::Status BlobWriter::Append(std::string_view bytes) {
  const auto count = static_cast<int64_t>(bytes.size());
  // Quotas count the declared size, so no more is ever written.
  if (written_ + count > target_.size) {
    return absl::InvalidArgumentError(absl::StrCat("more bytes than the ", target_.size,
                                                   " declared: at least ", written_ + count));
  }
  for (std::string_view left = bytes; !left.empty();) {
    const ssize_t put = write(file_.descriptor(), left.data(), left.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return FileError(target_.partial, "cannot write", errno);
    left.remove_prefix(static_cast<size_t>(put));
  }
  digest_.Add(bytes);
  written_ += count;
  hashed_ = written_;
  // The last part is committed with the whole file.
  const bool due = written_ - committed_ >= kCommitBytes && written_ < target_.size;
  return due ? Record() : absl::OkStatus();
}

absl::Status BlobWriter::Sync() {
  if (fsync(file_.descriptor()) == 0) return absl::OkStatus();
  // Do not try again: Linux reports a failed write once, so a second fsync could succeed although
  // the bytes are lost.
  written_ = committed_;
  return FileError(target_.partial, "cannot sync", errno);
}

// The length is written after the bytes are synced, so that it never counts bytes that a power cut
// may lose.
absl::Status BlobWriter::Record() {
  RETURN_IF_ERROR(Sync());
  RETURN_IF_ERROR(WriteFileAtomically(LengthPath(target_.partial), absl::StrCat(written_, "\n")));
  committed_ = written_;
  return absl::OkStatus();
}

absl::Status BlobWriter::Discard() {
  ended_ = true;
  std::error_code error;
  fs::remove(LengthPath(target_.partial), error);
  if (!error) fs::remove(target_.partial, error);
  return error ? FileError(target_.partial, "cannot remove", error.value()) : absl::OkStatus();
}

absl::Status BlobWriter::Finish() {
  if (written_ != target_.size) {
    return absl::InvalidArgumentError(
        absl::StrCat("ended after ", written_, " of the ", target_.size, " bytes declared"));
  }
  const std::string found = digest_.Hex();
  // Otherwise the bytes are of no use to anyone: the next upload of the file starts from 0.
  if (found == target_.sha256) return absl::OkStatus();
  Discard().IgnoreError();
  return absl::DataLossError(
      absl::StrCat("the bytes have the SHA-256 ", found, ", declared was ", target_.sha256));
}

absl::Status BlobWriter::Publish() {
  std::error_code error;
  // Atomic: readers find the whole blob or none. The name is durable once its folder is synced.
  fs::rename(target_.partial, target_.blob, error);
  if (error) return FileError(target_.blob, "cannot rename to", error.value());
  ended_ = true;
  fs::remove(LengthPath(target_.partial), error);  // without the partial file it has no meaning
  return absl::OkStatus();
}

absl::Status BlobWriter::Commit() {
  RETURN_IF_ERROR(Finish());
  RETURN_IF_ERROR(Sync());
  RETURN_IF_ERROR(Publish());
  return SyncFolder(target_.blob.parent_path());
}

}  // namespace pepeseg
