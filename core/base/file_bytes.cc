#include "core/base/file_bytes.h"

#include <algorithm>
#include <fstream>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {

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

}  // namespace pepeseg
