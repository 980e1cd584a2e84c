#include "server/services/file_header.h"

#include <algorithm>
#include <fstream>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/ply.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// A PLY file with more points than this is refused by its header.
constexpr int64_t kMaxPoints = 50'000'000;

absl::Status Unreadable(const DatasetFileRow& file) {
  return absl::InternalError(absl::StrCat(file.path, ": cannot be read"));
}

// Returns the first `num_bytes` bytes of a file, or the whole file if it is shorter.
absl::StatusOr<std::string> ReadFront(const fs::path& blob, const DatasetFileRow& row,
                                      int64_t num_bytes) {
  std::ifstream file(blob, std::ios::binary);
  std::string front(static_cast<size_t>(std::min(num_bytes, row.size)), '\0');
  file.read(front.data(), static_cast<std::streamsize>(front.size()));
  if (!file) return Unreadable(row);
  return front;
}

// Reads the number of points from the start of COLMAP's points3D.bin. The number is not trusted
// beyond what a file of this size can hold.
absl::Status CountBinaryPoints(const fs::path& blob, DatasetFileRow& file) {
  // Bytes of a point without a track: id, position, colour, error and the length of the track.
  constexpr int64_t kLeastRecord = 43;
  ASSIGN_OR_RETURN(const std::string front, ReadFront(blob, file, 8));
  uint64_t count = 0;
  for (size_t i = 0; i < front.size(); ++i) {
    count |= uint64_t{static_cast<uint8_t>(front[i])} << (8 * i);
  }
  // The count is a little-endian uint64 at the start of the file.
  const bool whole = front.size() == sizeof(count);
  const auto most = static_cast<uint64_t>(file.size / kLeastRecord);
  file.num_points = whole ? static_cast<int64_t>(std::min(count, most)) : 0;
  return absl::OkStatus();
}

// Returns the number in COLMAP's comment "# Number of points: 1234, mean track length: 5", or -1.
int64_t NumberInComment(absl::string_view front) {
  constexpr absl::string_view kWords = "# Number of points:";
  const size_t at = front.find(kWords);
  int64_t number = -1;
  if (at == absl::string_view::npos) return -1;
  absl::string_view rest = front.substr(at + kWords.size(), 24);
  rest = rest.substr(0, rest.find_first_of(",\n"));
  return absl::SimpleAtoi(rest, &number) ? number : -1;
}

// Reads the number of points of COLMAP's points3D.txt from its comment. Without a comment, counts
// the lines in the first 64 KiB and assumes that the rest of the file has as many a byte.
absl::Status CountTextPoints(const fs::path& blob, DatasetFileRow& file) {
  constexpr int64_t kFrontBytes = 64 << 10;
  constexpr int64_t kLeastLine = 16;  // bytes of eight numbers of one digit
  ASSIGN_OR_RETURN(const std::string front, ReadFront(blob, file, kFrontBytes));
  // Not trusted beyond what the size of the file allows, like the number of the binary form.
  const int64_t said = NumberInComment(front);
  if (said >= 0) {
    file.num_points = std::min(said, file.size / kLeastLine);
    return absl::OkStatus();
  }
  int64_t count = 0;
  for (const absl::string_view line : absl::StrSplit(front, '\n')) {
    count += line.empty() || line[0] == '#' ? 0 : 1;
  }
  const double share = static_cast<double>(file.size) / static_cast<double>(front.size());
  file.num_points = static_cast<int64_t>(static_cast<double>(count) * share);
  return absl::OkStatus();
}

absl::Status CountPly(const fs::path& blob, DatasetFileRow& file) {
  const auto ply = OpenPly(blob, file.path, kMaxPoints);
  // Only a file whose contents are at fault is refused for good; an error of the disk is returned,
  // so that the header is read again.
  if (absl::IsInvalidArgument(ply.status())) {
    file.header = HeaderState::kRefused;
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(ply.status());
  file.num_points = ply->count;
  return absl::OkStatus();
}

absl::Status MeasurePhoto(const fs::path& blob, DatasetFileRow& file) {
  const auto size = ReadImageSize(blob, file.path);
  if (absl::IsInvalidArgument(size.status())) {
    file.header = HeaderState::kRefused;
    return absl::OkStatus();
  }
  RETURN_IF_ERROR(size.status());
  file.width = size->width;
  file.height = size->height;
  return absl::OkStatus();
}

bool IsBinaryPoints(const DatasetFileRow& file) {
  return absl::EndsWith(file.path, "points3D.bin");
}

bool IsTextPoints(const DatasetFileRow& file) { return absl::EndsWith(file.path, "points3D.txt"); }

}  // namespace

bool HasHeader(const DatasetFileRow& file) {
  // Among poses, only COLMAP's points say how many points there are.
  return file.kind == v1::FILE_KIND_IMAGE || file.kind == v1::FILE_KIND_POINTS ||
         file.kind == v1::FILE_KIND_GAUSSIANS ||
         (file.kind == v1::FILE_KIND_POSES && (IsBinaryPoints(file) || IsTextPoints(file)));
}

absl::Status ReadFileHeader(const fs::path& blob, DatasetFileRow& file) {
  if (!HasHeader(file)) return absl::OkStatus();
  // A copy, so that an error leaves `file` as unread.
  DatasetFileRow read = file;
  read.header = HeaderState::kRead;
  if (file.kind == v1::FILE_KIND_IMAGE) {
    RETURN_IF_ERROR(MeasurePhoto(blob, read));
  } else if (IsBinaryPoints(file) && file.kind != v1::FILE_KIND_GAUSSIANS) {
    RETURN_IF_ERROR(CountBinaryPoints(blob, read));
  } else if (IsTextPoints(file) && file.kind != v1::FILE_KIND_GAUSSIANS) {
    RETURN_IF_ERROR(CountTextPoints(blob, read));
  } else {
    RETURN_IF_ERROR(CountPly(blob, read));
  }
  file = std::move(read);
  return absl::OkStatus();
}

absl::Status RefusalOf(const fs::path& blob, const DatasetFileRow& file) {
  absl::Status refusal = ReadImageSize(blob, file.path).status();
  if (!refusal.ok()) return refusal;
  return absl::InvalidArgumentError(absl::StrCat(file.path, ": its header was refused"));
}

}  // namespace pepeseg
