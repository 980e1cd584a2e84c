#include "core/formats/movie_size.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "core/formats/movie_boxes.h"

namespace pepeseg {
namespace {

using Bytes = std::string_view;

constexpr int64_t kMaxFrames = int64_t{1} << 40;  // beyond it, a header is malformed

// Returns the number of frames as a whole number; 0 if no video has as many.
int64_t PlausibleFrames(double value) {
  return value >= 0 && value <= static_cast<double>(kMaxFrames) ? std::llround(value) : 0;
}

// Returns the first bytes of a file, where AVI and Matroska have their headers.
std::string ReadStart(const std::filesystem::path& path) {
  constexpr size_t kMostBytes = 256 << 10;
  std::string start(kMostBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<size_t>(std::max<std::streamsize>(0, file.gcount())));
  return start;
}

// Returns the samples of a track in the fragments of a file, whose tables in "moov" are empty.
int64_t CountFragmentSamples(const std::filesystem::path& path, uint64_t track) {
  uint64_t num = 0;
  ForEachFileBox(path, "moof", [&](Bytes fragment) {
    ForEachBox(fragment, [&](Bytes type, Bytes content) {
      // After version and flags, "tfhd" has the track and "trun" the number of samples.
      if (type != "traf" || BoxNumber(Box(content, "tfhd"), 4, 4) != track) return false;
      ForEachBox(content, [&](Bytes run, Bytes samples) {
        if (run == "trun") num += BoxNumber(samples, 4, 4);
        return false;
      });
      return false;
    });
    return false;
  });
  return PlausibleFrames(static_cast<double>(num));
}

MovieSize ReadBoxes(const std::filesystem::path& path) {
  const std::string movie = ReadMovieBox(path);
  const Bytes track = FirstVideoTrack(movie);
  MovieSize size;
  // After version, flags and the common size of the samples.
  const Bytes sizes = Box(SampleTable(track), "stsz");
  size.num_frames = static_cast<int64_t>(BoxNumber(sizes, 8, 4));
  const Bytes header = Box(track, "tkhd");
  if (header.size() < 8) return size;
  if (size.num_frames == 0) {
    // The track's number follows version, flags and two times, which have 64 bits in version 1.
    const size_t at = BoxNumber(header, 0, 1) == 1 ? 20 : 12;
    size.num_frames = CountFragmentSamples(path, BoxNumber(header, at, 4));
  }
  // Width and height are 16.16 fixed-point numbers at the end of the track header.
  size.width = static_cast<int>(BoxNumber(header, header.size() - 8, 2));
  size.height = static_cast<int>(BoxNumber(header, header.size() - 4, 2));
  return size;
}

// Returns the little-endian number of four bytes at `at`, or 0 beyond the end.
uint32_t LittleNumber(Bytes bytes, size_t at) {
  return __builtin_bswap32(static_cast<uint32_t>(BoxNumber(bytes, at, 4)));
}

// AVI (Microsoft's RIFF reference): chunks of a type, a little-endian size and the content, padded
// to an even size. "LIST" holds a type and chunks. Adds what the headers among `chunks` say.
void ReadAviChunks(Bytes chunks, int depth, MovieSize& size) {
  constexpr size_t kHeader = 8;
  constexpr int kDeepest = 4;
  while (chunks.size() >= kHeader) {
    const Bytes type = chunks.substr(0, 4);
    const uint64_t declared = LittleNumber(chunks, 4);
    const Bytes content = chunks.substr(kHeader, declared);  // cut at the end of what was read
    const Bytes list = type == "LIST" ? content.substr(0, 4) : Bytes();
    if (list == "movi") return;  // the frames
    const auto add = [&](uint32_t num) {
      size.num_frames = std::max(size.num_frames, int64_t{num});
    };
    if (type == "LIST" && content.size() >= 4 && depth < kDeepest) {
      ReadAviChunks(content.substr(4), depth + 1, size);
    } else if (type == "avih") {
      add(LittleNumber(content, 16));
      size.width = static_cast<int>(LittleNumber(content, 32) & 0xffff);
      size.height = static_cast<int>(LittleNumber(content, 36) & 0xffff);
    } else if (type == "strh" && content.substr(0, 4) == "vids") {
      add(LittleNumber(content, 32));
    } else if (type == "dmlh") {  // OpenDML: "avih" counts only the first of several RIFF chunks
      add(LittleNumber(content, 0));
    }
    const uint64_t whole = kHeader + declared + declared % 2;
    if (whole > chunks.size()) return;
    chunks.remove_prefix(whole);
  }
}

// Matroska (RFC 8794, RFC 9559): elements of an id and a size of variable length, and the content.
struct Element {
  uint64_t id = 0;
  Bytes content;
  bool cut = false;  // the bytes end before the content does
};

// Removes a number of variable length from the front of `bytes`. The zeros in front of the first
// one bit are the number of further bytes. `keep_marker`: that bit is part of ids, not of sizes. A
// size of ones only is unknown: returns the largest number. Returns nothing if it is malformed.
std::optional<uint64_t> TakeVariable(Bytes& bytes, bool keep_marker) {
  if (bytes.empty()) return std::nullopt;
  const auto first = static_cast<uint8_t>(bytes[0]);
  const auto length = static_cast<size_t>(std::countl_zero(first)) + 1;
  if (length > 8 || bytes.size() < length) return std::nullopt;
  uint64_t value = BoxNumber(bytes, 0, length);
  bytes.remove_prefix(length);
  if (keep_marker) return value;
  const uint64_t most = (uint64_t{1} << (7 * length)) - 1;
  value &= most;
  return value == most ? std::numeric_limits<uint64_t>::max() : value;
}

// Removes the next element from the front. Its content is cut at the end of `bytes`.
std::optional<Element> TakeElement(Bytes& bytes) {
  const auto id = TakeVariable(bytes, true);
  if (!id) return std::nullopt;
  const auto size = TakeVariable(bytes, false);
  if (!size) return std::nullopt;
  const Element element = {*id, bytes.substr(0, *size), *size > bytes.size()};
  bytes.remove_prefix(element.content.size());
  return element;
}

// Returns the content of the first element with this id; nothing if there is none or it is cut.
Bytes FindElement(Bytes bytes, uint64_t id) {
  while (const auto element = TakeElement(bytes)) {
    if (element->id == id) return element->cut ? Bytes() : element->content;
  }
  return {};
}

// Returns an unsigned number of up to eight bytes.
uint64_t Unsigned(Bytes content) {
  return content.size() <= 8 ? BoxNumber(content, 0, content.size()) : 0;
}

// Returns a floating-point number of four or eight bytes; 0 for other sizes.
double Float(Bytes content) {
  if (content.size() == 4) {
    return std::bit_cast<float>(static_cast<uint32_t>(BoxNumber(content, 0, 4)));
  }
  return content.size() == 8 ? std::bit_cast<double>(BoxNumber(content, 0, 8)) : 0;
}

MovieSize ReadMatroska(Bytes file) {
  constexpr uint64_t kSegment = 0x18538067, kInfo = 0x1549a966, kTimestampScale = 0x2ad7b1,
                     kDuration = 0x4489, kTracks = 0x1654ae6b, kTrackEntry = 0xae,
                     kTrackType = 0x83, kVideoTrack = 1, kDefaultDuration = 0x23e383, kVideo = 0xe0,
                     kPixelWidth = 0xb0, kPixelHeight = 0xba;
  constexpr double kUsualScale = 1e6, kUsualFrame = 1e9 / 30;  // ns
  // The segment is nearly the whole file, of which `file` is the start.
  Bytes segment;
  while (const auto element = TakeElement(file)) {
    if (element->id == kSegment) segment = element->content;
  }
  const Bytes info = FindElement(segment, kInfo);
  const Bytes scale = FindElement(info, kTimestampScale);
  const double duration = Float(FindElement(info, kDuration)) *
                          (scale.empty() ? kUsualScale : static_cast<double>(Unsigned(scale)));
  Bytes tracks = FindElement(segment, kTracks);
  while (const auto track = TakeElement(tracks)) {
    if (track->id != kTrackEntry) continue;
    if (Unsigned(FindElement(track->content, kTrackType)) != kVideoTrack) continue;
    const uint64_t frame = Unsigned(FindElement(track->content, kDefaultDuration));
    const Bytes video = FindElement(track->content, kVideo);
    MovieSize size;
    size.num_frames =
        PlausibleFrames(duration / (frame > 0 ? static_cast<double>(frame) : kUsualFrame));
    size.width = static_cast<int>(Unsigned(FindElement(video, kPixelWidth)) & 0xffff);
    size.height = static_cast<int>(Unsigned(FindElement(video, kPixelHeight)) & 0xffff);
    return size;
  }
  return {};
}

}  // namespace

MovieSize ReadMovieSize(const std::filesystem::path& path) {
  const std::string start = ReadStart(path);
  const Bytes bytes = start;
  if (bytes.substr(0, 4) == "\x1a\x45\xdf\xa3") return ReadMatroska(bytes);
  if (bytes.substr(0, 4) != "RIFF" || bytes.size() < 12 || bytes.substr(8, 4) != "AVI ") {
    return ReadBoxes(path);
  }
  MovieSize size;
  ReadAviChunks(bytes.substr(12), 0, size);
  return size;
}

}  // namespace pepeseg
