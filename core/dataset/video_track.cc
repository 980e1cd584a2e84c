#include "core/dataset/video_track.h"

#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/formats/movie_boxes.h"
#include "opencv2/imgproc.hpp"

namespace pepeseg {
namespace {

using Bytes = std::string_view;

constexpr size_t kSampleEntryBytes = 86;  // a VisualSampleEntry in front of its boxes, ISO 14496-12

// Sets the display matrix from a track header.
void ReadMatrix(Bytes tkhd, VideoTrack& track) {
  // Times and durations have 64 bits from version 1 on.
  const size_t at = BoxNumber(tkhd, 0, 1) == 0 ? 40 : 52;
  if (tkhd.size() < at + 36) return;
  const auto sign = [&](size_t index) {
    const auto value = static_cast<int32_t>(BoxNumber(tkhd, at + 4 * index, 4));
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
  if (coded && colr.size() >= 10)
    track.matrix_coefficients = static_cast<int>(BoxNumber(colr, 8, 2));
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
  const Bytes content = FirstVideoTrack(movie);
  ReadMatrix(Box(content, "tkhd"), track);
  ReadColours(Box(SampleTable(content), "stsd"), track);
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
