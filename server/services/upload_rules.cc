#include "server/services/upload_rules.h"

#include <algorithm>
#include <cstdint>
#include <set>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/api/convert.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

// Limits of one CreateUpload. They bound what a request, its records and its partial files take;
// dataset_service.proto states them.
constexpr size_t kMaxPathBytes = 512;
constexpr int kMaxFiles = 20'000;
constexpr size_t kMaxPathBytesInAll = size_t{2} << 20;
constexpr int64_t kMaxFileBytes = int64_t{4} << 30;
constexpr int64_t kMaxBytesInAll = int64_t{256} << 30;

bool IsSha256(const std::string& text) {
  return text.size() == 64 && std::all_of(text.begin(), text.end(), [](char c) {
           return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f');
         });
}

absl::StatusOr<DatasetFileRecord> CheckFile(const v1::FileDeclaration& file,
                                            const std::string& field) {
  RETURN_IF_ERROR(CheckUploadPath(file.path(), field + ".path"));
  if (!FileKindFromProto(file.kind()).ok()) {
    return BadField(field + ".kind", absl::StrCat(static_cast<int>(file.kind())),
                    absl::StrCat("no kind of file (of ", file.path(), ")"));
  }
  if (file.size() < 1 || file.size() > kMaxFileBytes) {
    return BadField(
        field + ".size", absl::StrCat(file.size()),
        absl::StrCat("allowed are 1..", kMaxFileBytes, " bytes (of ", file.path(), ")"));
  }
  if (!IsSha256(file.sha256())) {
    return BadField(field + ".sha256", file.sha256(),
                    absl::StrCat("not 64 lower-case hex digits (of ", file.path(), ")"));
  }
  return DatasetFileRecord{file.path(), static_cast<int>(file.kind()), file.size(), file.sha256(),
                           false};
}

}  // namespace

absl::Status CheckUploadPath(const std::string& path, const std::string& field) {
  if (path.empty() || path.size() > kMaxPathBytes) {
    return BadField(field, path,
                    absl::StrCat(path.size(), " bytes, allowed are 1..", kMaxPathBytes));
  }
  if (Utf8Prefix(path, kMaxPathBytes) != path) return BadField(field, path, "not UTF-8");
  for (char c : path) {
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c)) || c == '\\') {
      return BadField(field, path, "has a control character or a backslash");
    }
  }
  for (const absl::string_view part : absl::StrSplit(path, '/')) {
    if (part.empty()) return BadField(field, path, "is absolute or has an empty part");
    if (part == "." || part == "..") {
      return BadField(field, path, absl::StrCat("has the part '", part, "'"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<DatasetFileRecord>> CheckUploadFiles(
    const v1::CreateUploadRequest& request) {
  if (request.files().empty() || request.files_size() > kMaxFiles) {
    return BadField("files", absl::StrCat(request.files_size()),
                    absl::StrCat("files; allowed are 1..", kMaxFiles));
  }
  std::vector<DatasetFileRecord> files;
  std::set<std::string> paths;
  size_t path_bytes = 0;
  int64_t num_bytes = 0;
  for (const v1::FileDeclaration& file : request.files()) {
    const std::string field = absl::StrCat("files[", files.size(), "]");
    ASSIGN_OR_RETURN(DatasetFileRecord record, CheckFile(file, field));
    // Paths are compared by bytes. The files are stored by digest, so names that differ only in
    // case do not collide on the disk.
    if (!paths.insert(record.path).second)
      return BadField(field + ".path", record.path, "listed twice");
    path_bytes += record.path.size();
    num_bytes += record.size;
    files.push_back(std::move(record));
  }
  if (path_bytes > kMaxPathBytesInAll) {
    return BadField("files", absl::StrCat(path_bytes),
                    absl::StrCat("bytes of paths; allowed are ", kMaxPathBytesInAll));
  }
  if (num_bytes > kMaxBytesInAll) {
    return BadField("files", absl::StrCat(num_bytes),
                    absl::StrCat("bytes in all; allowed are ", kMaxBytesInAll));
  }
  return files;
}

}  // namespace pepeseg
