#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_files.h"
#include "core/formats/image_header.h"
#include "core/formats/ply.h"

namespace pepeseg {
namespace {

// A PLY file with more points than this is refused by its header.
constexpr int64_t kMaxPlyPoints = 50'000'000;

// The first bytes of a file, and its size.
struct Front {
  std::string bytes;
  int64_t file_size = 0;
};

// Reads the first `num_bytes` bytes of a file, or the whole file if it is shorter.
absl::StatusOr<Front> ReadFront(const DatasetFile& file, int64_t num_bytes) {
  Front front;
  ASSIGN_OR_RETURN(front.file_size, FileSize(file.path, file.name));
  front.bytes.resize(static_cast<size_t>(std::min(num_bytes, front.file_size)));
  std::ifstream stream(file.path, std::ios::binary);
  stream.read(front.bytes.data(), static_cast<std::streamsize>(front.bytes.size()));
  if (!stream) return absl::InternalError(absl::StrCat(file.name, ": cannot be read"));
  return front;
}

// Returns the number of points that the start of COLMAP's points3D.bin states. The number is not
// trusted beyond what a file of this size can hold.
absl::StatusOr<int64_t> CountBinaryPoints(const DatasetFile& file) {
  // Bytes of a point without a track: id, position, colour, error and the length of the track.
  constexpr int64_t kLeastRecord = 43;
  ASSIGN_OR_RETURN(const Front front, ReadFront(file, 8));
  // The count is a little-endian uint64 at the start of the file.
  uint64_t count = 0;
  if (front.bytes.size() != sizeof(count)) return 0;
  for (size_t i = 0; i < front.bytes.size(); ++i) {
    count |= uint64_t{static_cast<uint8_t>(front.bytes[i])} << (8 * i);
  }
  return std::min<uint64_t>(count, front.file_size / kLeastRecord);
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

// Returns the number of points that the comment of COLMAP's points3D.txt states. Without a comment,
// counts the lines in the first 64 KiB and assumes that the rest of the file has as many a byte.
absl::StatusOr<int64_t> CountTextPoints(const DatasetFile& file) {
  constexpr int64_t kFrontBytes = 64 << 10;
  constexpr int64_t kLeastLine = 16;  // bytes of eight numbers of one digit
  ASSIGN_OR_RETURN(const Front front, ReadFront(file, kFrontBytes));
  // Not trusted beyond what the size of the file allows, like the number of the binary form.
  const int64_t said = NumberInComment(front.bytes);
  if (said >= 0) return std::min(said, front.file_size / kLeastLine);
  int64_t count = 0;
  for (const absl::string_view line : absl::StrSplit(front.bytes, '\n')) {
    count += line.empty() || line[0] == '#' ? 0 : 1;
  }
  if (count == 0) return 0;
  const double share =
      static_cast<double>(front.file_size) / static_cast<double>(front.bytes.size());
  return static_cast<int64_t>(static_cast<double>(count) * share);
}

bool IsBinaryPoints(absl::string_view name) { return absl::EndsWith(name, "points3D.bin"); }
bool IsTextPoints(absl::string_view name) { return absl::EndsWith(name, "points3D.txt"); }

}  // namespace

bool HasFacts(FileKind kind, absl::string_view name) {
  // Among poses, only COLMAP's points say how many points there are.
  return kind == FileKind::kImage || kind == FileKind::kPoints || kind == FileKind::kGaussians ||
         (kind == FileKind::kPoses && (IsBinaryPoints(name) || IsTextPoints(name)));
}

absl::StatusOr<FileFacts> ReadFileFacts(const DatasetFile& file) {
  FileFacts facts;
  if (file.kind == FileKind::kImage) {
    ASSIGN_OR_RETURN(const ImageHeader header, ReadImageSize(file.path, file.name));
    facts.width = header.width;
    facts.height = header.height;
  } else if (IsBinaryPoints(file.name) && file.kind != FileKind::kGaussians) {
    ASSIGN_OR_RETURN(facts.num_points, CountBinaryPoints(file));
  } else if (IsTextPoints(file.name) && file.kind != FileKind::kGaussians) {
    ASSIGN_OR_RETURN(facts.num_points, CountTextPoints(file));
  } else {
    ASSIGN_OR_RETURN(const PlyVertices ply, OpenPly(file.path, file.name, kMaxPlyPoints));
    facts.num_points = ply.count;
  }
  return facts;
}

}  // namespace pepeseg
