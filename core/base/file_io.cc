#include "core/base/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr mode_t kFileMode = 0644;

// Returns the error of errno, with the action and the path that it failed for.
absl::Status Failed(absl::string_view action, const std::filesystem::path& path) {
  return absl::ErrnoToStatus(errno, absl::StrCat(action, " ", path.string()));
}

// Returns the folder of a path; "." for a bare name.
std::filesystem::path FolderOf(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

}  // namespace

absl::StatusOr<int64_t> FileSize(const std::filesystem::path& path, absl::string_view name) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(name, ": no such file"));
  }
  // A FIFO or device could block a read, or never end.
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": not a regular file"));
  }
  const auto size = std::filesystem::file_size(path, error);
  if (error) return absl::InternalError(absl::StrCat(name, ": ", error.message()));
  return static_cast<int64_t>(size);
}

absl::StatusOr<std::string> ReadFile(const std::filesystem::path& path, absl::string_view name,
                                     int64_t max_bytes) {
  ASSIGN_OR_RETURN(const int64_t size, FileSize(path, name));
  // Before memory is allocated for it.
  if (size > max_bytes) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", size, " bytes, the limit is ", max_bytes));
  }
  std::ifstream file(path, std::ios::binary);
  std::string bytes(static_cast<size_t>(size), '\0');
  // A file that shrinks meanwhile is an error; one that grows is read up to its former size.
  file.read(bytes.data(), size);
  if (!file || file.gcount() != size) {
    return absl::InternalError(absl::StrCat(name, ": cannot be read"));
  }
  return bytes;
}

std::string ReadFileTail(const std::filesystem::path& path, size_t max_bytes) {
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  if (!stream) return "";
  const auto size = static_cast<size_t>(stream.tellg());
  const size_t length = std::min(size, max_bytes);
  std::string tail(length, '\0');
  stream.seekg(static_cast<std::streamoff>(size - length));
  stream.read(tail.data(), static_cast<std::streamsize>(length));
  tail.resize(static_cast<size_t>(stream.gcount()));
  // Drops the first line if the tail begins within it.
  const size_t line = tail.find('\n');
  if (length < size && line != std::string::npos) tail.erase(0, line + 1);
  return tail;
}

absl::StatusOr<AtomicFile> AtomicFile::Create(const std::filesystem::path& path) {
  // In the same folder, because rename() works only within a file system.
  std::string temporary = path.string() + ".tmp-XXXXXX";
  const int descriptor = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (descriptor < 0) return Failed("cannot create", path);
  AtomicFile file(path, std::move(temporary), descriptor);
  // mkostemp() creates files with mode 0600, which other users cannot read.
  if (::fchmod(descriptor, kFileMode) != 0) return Failed("cannot set the mode of", path);
  return file;
}

AtomicFile::AtomicFile(std::filesystem::path path, std::string temporary, int descriptor)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::exchange(other.temporary_, {})),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

AtomicFile& AtomicFile::operator=(AtomicFile&& other) noexcept {
  if (this != &other) {
    Discard();
    path_ = std::move(other.path_);
    temporary_ = std::exchange(other.temporary_, {});
    descriptor_ = std::exchange(other.descriptor_, -1);
  }
  return *this;
}

AtomicFile::~AtomicFile() { Discard(); }

void AtomicFile::Discard() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  if (!temporary_.empty()) ::unlink(std::exchange(temporary_, {}).c_str());
}

absl::Status AtomicFile::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return Failed("cannot write", path_);
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

absl::Status AtomicFile::Append(std::span<const uint8_t> bytes) {
  return Append(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

absl::Status AtomicFile::Commit() {
  // The bytes must be on the disk before the name: otherwise a power failure could leave the name
  // with an empty file.
  if (::fsync(descriptor_) != 0) return Failed("cannot sync", path_);
  // Network file systems may report a failed write only when the file is closed.
  if (::close(std::exchange(descriptor_, -1)) != 0) return Failed("cannot close", path_);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) return Failed("cannot rename to", path_);
  temporary_.clear();  // nothing left for Discard
  return SyncFolder(FolderOf(path_));
}

absl::Status WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes) {
  ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  RETURN_IF_ERROR(file.Append(bytes));
  return file.Commit();
}

absl::Status SyncFolder(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return Failed("cannot open folder", folder);
  const int synced = ::fsync(descriptor);
  absl::Status status = synced == 0 ? absl::OkStatus() : Failed("cannot sync folder", folder);
  ::close(descriptor);
  return status;
}

}  // namespace pepeseg
