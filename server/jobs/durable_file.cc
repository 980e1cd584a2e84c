#include "server/jobs/durable_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <sstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"

namespace pepeseg {
namespace {

// A file descriptor that closes with its scope.
class OpenFile {
 public:
  OpenFile(const std::filesystem::path& path, int flags)
      : descriptor_(open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  ~OpenFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

absl::Status WriteAndSync(const std::filesystem::path& path, const std::string& bytes) {
  const OpenFile file(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (file.get() < 0) return FileError(path, "create", errno);
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t wrote = write(file.get(), bytes.data() + done, bytes.size() - done);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return FileError(path, "write", errno);
    done += static_cast<size_t>(wrote);
  }
  if (fsync(file.get()) != 0) return FileError(path, "fsync", errno);
  return absl::OkStatus();
}

}  // namespace

absl::Status FileError(const std::filesystem::path& path, const std::string& what, int error) {
  const std::string message =
      absl::StrCat(path.string(), ": ", what, ": ", std::generic_category().message(error));
  if (error == ENOENT) return absl::NotFoundError(message);
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    return absl::ResourceExhaustedError(message);
  }
  return absl::InternalError(message);
}

absl::Status WriteFileDurably(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::path temporary = path;
  temporary += ".tmp";
  RETURN_IF_ERROR(WriteAndSync(temporary, bytes));
  if (rename(temporary.c_str(), path.c_str()) != 0) return FileError(path, "rename", errno);
  const OpenFile folder(path.parent_path(), O_RDONLY | O_DIRECTORY);
  if (folder.get() < 0 || fsync(folder.get()) != 0) {
    return FileError(path.parent_path(), "fsync", errno);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& path, size_t max_bytes) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error) return FileError(path, "read", error.value());
  if (size > max_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path.string(), ": ", size, " bytes, the limit is ", max_bytes));
  }
  std::ifstream stream(path, std::ios::binary);
  std::stringstream bytes;
  bytes << stream.rdbuf();
  if (!stream) return FileError(path, "read", EIO);
  return bytes.str();
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
  const size_t line = tail.find('\n');
  if (length < size && line != std::string::npos) tail.erase(0, line + 1);
  return tail;
}

}  // namespace pepeseg
