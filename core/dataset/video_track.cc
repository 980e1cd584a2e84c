#include "core/dataset/video_track.h"

#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

using Bytes = std::string_view;

constexpr uint64_t kMaxHeaderBytes = 64 << 20;
constexpr int kMaxBoxes = 4096;           // at the top of a file; fragmented files have many
constexpr size_t kSampleEntryBytes = 86;  // a VisualSampleEntry in front of its boxes, ISO 14496-12

// Returns the big-endian number at `at`, or 0 beyond the end.
uint64_t Number(Bytes bytes, size_t at, size_t length) {
  if (at > bytes.size() || bytes.size() - at < length) return 0;
  uint64_t value = 0;
  for (const char byte : bytes.substr(at, length)) value = value << 8 | static_cast<uint8_t>(byte);
  return value;
}

// Calls use(type, content) for each box of `bytes` until it returns true.
template <class Use>
void ForEachBox(Bytes bytes, Use use) {
  constexpr size_t kHeader = 8;
  while (bytes.size() >= kHeader) {
    const uint64_t declared = Number(bytes, 0, 4);
    const uint64_t size = declared == 0 ? bytes.size() : declared;
    if (size < kHeader || size > bytes.size()) return;  // boxes of 64-bit sizes hold only samples
    if (use(bytes.substr(4, 4), bytes.substr(kHeader, size - kHeader))) return;
    bytes.remove_prefix(size);
  }
}

// Returns the content of the first box of a type, or nothing.
Bytes Box(Bytes bytes, Bytes type) {
  Bytes found;
  ForEachBox(bytes, [&](Bytes of, Bytes content) {
    if (of == type) found = content;
    return of == type;
  });
  return found;
}

// Returns the content of the file's box "moov", which may follow gigabytes of samples.
std::string ReadMovieBox(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  uint64_t at = 0;
  for (int i = 0; i < kMaxBoxes; ++i) {
    std::string head(16, '\0');
    file.seekg(static_cast<std::streamoff>(at));
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    if (file.gcount() < 8) return "";
    file.clear();
    const uint64_t declared = Number(head, 0, 4);
    const uint64_t header = declared == 1 ? 16 : 8;
    const uint64_t size = declared == 1 ? Number(head, 8, 8) : declared;
    // A size of 0 means up to the end of the file, which only samples have.
    if (size < header || size > uint64_t{1} << 62) return "";
    if (Bytes(head).substr(4, 4) != "moov") {
      at += size;
      if (at > uint64_t{1} << 62) return "";
      continue;
    }
    if (size - header > kMaxHeaderBytes) return "";
    std::string content(size - header, '\0');
    file.seekg(static_cast<std::streamoff>(at + header));
    file.read(content.data(), static_cast<std::streamsize>(content.size()));
    content.resize(static_cast<size_t>(file.gcount()));
    return content;
  }
  return "";
}

// Sets the display matrix from a track header.
void ReadMatrix(Bytes tkhd, VideoTrack& track) {
  // Times and durations have 64 bits from version 1 on.
  const size_t at = Number(tkhd, 0, 1) == 0 ? 40 : 52;
  if (tkhd.size() < at + 36) return;
  const auto sign = [&](size_t index) {
    const auto value = static_cast<int32_t>(Number(tkhd, at + 4 * index, 4));
    return value > 0 ? 1 : value < 0 ? -1 : 0;
  };
  const int a = sign(0), b = sign(1), c = sign(3), d = sign(4);
  const bool straight = a != 0 && d != 0 && b == 0 && c == 0;
  const bool transposed = a == 0 && d == 0 && b != 0 && c != 0;
  if (!straight && !transposed) return;  // shown as stored, as players do
  track.a = a, track.b = b, track.c = c, track.d = d;
}

// Sets the coefficients from a track's sample descriptions.
void ReadColours(Bytes stsd, VideoTrack& track) {
  constexpr size_t kListHeader = 8;  // version, flags and count
  if (stsd.size() < kListHeader + kSampleEntryBytes) return;
  const Bytes colr = Box(stsd.substr(kListHeader + kSampleEntryBytes), "colr");
  const bool coded = colr.starts_with("nclx") || colr.starts_with("nclc");
  if (coded && colr.size() >= 10) track.matrix_coefficients = static_cast<int>(Number(colr, 8, 2));
}

// Returns the luma coefficients (red, blue) of a matrix by H.273, or nothing if it is BT.601's, is
// unknown or is not one of luma and chroma.
std::optional<std::pair<double, double>> LumaOf(int matrix_coefficients) {
  switch (matrix_coefficients) {
    case 1:
      return {{0.2126, 0.0722}};
    case 7:
      return {{0.212, 0.087}};
    case 9:
      return {{0.2627, 0.0593}};
    default:
      return std::nullopt;
  }
}

// Returns the matrix from (Y, Cb, Cr) to (B, G, R).
cv::Matx33d BgrFromYcc(double red, double blue) {
  const double green = 1 - red - blue;
  return {1, 2 * (1 - blue), 0, 1, -2 * (1 - blue) * blue / green, -2 * (1 - red) * red / green, 1,
          0, 2 * (1 - red)};
}

}  // namespace

VideoTrack ReadVideoTrack(const std::filesystem::path& path) {
  VideoTrack track;
  const std::string movie = ReadMovieBox(path);
  ForEachBox(movie, [&](Bytes type, Bytes content) {
    const Bytes media = type == "trak" ? Box(content, "mdia") : Bytes();
    const Bytes handler = Box(media, "hdlr");
    if (handler.size() < 12 || handler.substr(8, 4) != "vide") return false;
    ReadMatrix(Box(content, "tkhd"), track);
    ReadColours(Box(Box(Box(media, "minf"), "stbl"), "stsd"), track);
    return true;
  });
  return track;
}

cv::Mat ShownFrame(const cv::Mat& frame, const VideoTrack& track) {
  cv::Mat shown = frame;
  if (const auto luma = LumaOf(track.matrix_coefficients)) {
    const cv::Matx33d from_601 =
        BgrFromYcc(luma->first, luma->second) * BgrFromYcc(0.299, 0.114).inv();
    cv::transform(frame, shown, from_601);
  }
  const bool transposed = track.a == 0;
  if (transposed) cv::transpose(shown, shown);
  constexpr int kAroundX = 0, kAroundY = 1;  // codes of cv::flip
  if ((transposed ? track.c : track.a) < 0) cv::flip(shown, shown, kAroundY);
  if ((transposed ? track.b : track.d) < 0) cv::flip(shown, shown, kAroundX);
  return shown;
}

}  // namespace pepeseg
