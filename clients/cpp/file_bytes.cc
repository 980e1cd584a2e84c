#include "clients/cpp/file_bytes.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client {
namespace {

constexpr char kLocalFileUrl[] = "pepeseg.client/local_file";
constexpr size_t kReadBytes = size_t{1} << 20;

// Adds the payload by which IsLocalFileError knows the error.
absl::Status Mark(absl::Status status) {
  status.SetPayload(kLocalFileUrl, absl::Cord());
  return status;
}

// Returns the code for an errno; the client maps it to an exit code.
absl::StatusCode CodeOf(int error_number) {
  switch (error_number) {
    case ENOENT:
    case ENOTDIR:
      return absl::StatusCode::kNotFound;
    case EACCES:
    case EPERM:
    case EROFS:
      return absl::StatusCode::kPermissionDenied;
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return absl::StatusCode::kResourceExhausted;
    default:
      return absl::StatusCode::kFailedPrecondition;
  }
}

}  // namespace

absl::Status LocalFileError(absl::string_view action, const std::filesystem::path& path,
                            int error_number) {
  const std::string text = std::generic_category().message(error_number);
  return Mark(
      {CodeOf(error_number), absl::StrCat("cannot ", action, " ", path.string(), ": ", text)});
}

absl::Status LocalFileMissing(const std::string& message) {
  return Mark(absl::NotFoundError(message));
}

bool IsLocalFileError(const absl::Status& status) {
  return status.GetPayload(kLocalFileUrl).has_value();
}

absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return LocalFileError("read", path, errno);
  std::string bytes;
  ssize_t size = 0;
  do {
    const size_t before = bytes.size();
    // Read to the end instead of by the size: a pipe has none.
    bytes.resize(before + kReadBytes);
    size = read(descriptor, bytes.data() + before, kReadBytes);
    bytes.resize(before + (size > 0 ? static_cast<size_t>(size) : 0));
  } while (size > 0 || (size < 0 && errno == EINTR));
  const int error_number = errno;  // close() may change it
  close(descriptor);
  if (size < 0) return LocalFileError("read", path, error_number);
  return bytes;
}

absl::Status MakeParentFolder(const std::filesystem::path& file) {
  if (!file.has_parent_path()) return absl::OkStatus();
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  return error ? LocalFileError("create the folder", file.parent_path(), error.value())
               : absl::OkStatus();
}

absl::Status WriteFile(const std::filesystem::path& path, absl::string_view bytes) {
  ASSIGN_OR_RETURN(OutputFile file, OutputFile::Create(path));
  RETURN_IF_ERROR(file.Append(bytes));
  return file.Commit();
}

OutputFile::OutputFile(std::filesystem::path path, int descriptor)
    // Bytes go to FILE.part, which Commit renames, so that a failed call leaves no half of a file.
    : path_(std::move(path)), part_(path_), descriptor_(descriptor) {
  part_ += ".part";
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      part_(std::move(other.part_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      num_bytes_(other.num_bytes_) {}

OutputFile::~OutputFile() {
  // Committed, moved from, or never opened: there is nothing to remove.
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink(part_.c_str());
}

absl::StatusOr<OutputFile> OutputFile::Create(const std::filesystem::path& path) {
  // Renaming to a folder would fail only in Commit, after all bytes were written.
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return LocalFileError("write", path, EISDIR);
  RETURN_IF_ERROR(MakeParentFolder(path));
  OutputFile file(path, -1);
  constexpr int kMode = 0666;  // the umask is subtracted
  file.descriptor_ = open(file.part_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kMode);
  if (file.descriptor_ < 0) return file.Fail(errno);
  return file;
}

absl::Status OutputFile::Fail(int error_number) const {
  return LocalFileError("write", path_, error_number);
}

absl::Status OutputFile::Append(absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t size = write(descriptor_, bytes.data(), bytes.size());
    // Interrupted by a signal before anything was written.
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return Fail(errno);
    num_bytes_ += size;
    bytes.remove_prefix(static_cast<size_t>(size));
  }
  return absl::OkStatus();
}

absl::Status OutputFile::Commit() {
  // A network file system may report a full disk only here.
  if (close(std::exchange(descriptor_, -1)) != 0) {
    const int error_number = errno;
    unlink(part_.c_str());
    return Fail(error_number);
  }
  if (rename(part_.c_str(), path_.c_str()) == 0) return absl::OkStatus();
  const int error_number = errno;
  unlink(part_.c_str());
  return Fail(error_number);
}

}  // namespace pepeseg::client
