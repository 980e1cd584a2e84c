#include "core/formats/movie_boxes.h"

#include <fstream>

namespace pepeseg {
namespace {

using Bytes = std::string_view;

constexpr uint64_t kMaxHeaderBytes = 64 << 20;
constexpr int kMaxBoxes = 4096;  // at the top of a file; fragmented files have many

// Calls use(type, content) for each box of `bytes` until it returns true.
template <class Use>
void ForEachBox(Bytes bytes, Use use) {
  constexpr size_t kHeader = 8;
  while (bytes.size() >= kHeader) {
    const uint64_t declared = BoxNumber(bytes, 0, 4);
    const uint64_t size = declared == 0 ? bytes.size() : declared;
    if (size < kHeader || size > bytes.size()) return;  // boxes of 64-bit sizes hold only samples
    if (use(bytes.substr(4, 4), bytes.substr(kHeader, size - kHeader))) return;
    bytes.remove_prefix(size);
  }
}

}  // namespace

uint64_t BoxNumber(std::string_view bytes, size_t at, size_t length) {
  if (at > bytes.size() || bytes.size() - at < length) return 0;
  uint64_t value = 0;
  for (const char byte : bytes.substr(at, length)) value = value << 8 | static_cast<uint8_t>(byte);
  return value;
}

std::string_view Box(std::string_view bytes, std::string_view type) {
  Bytes found;
  ForEachBox(bytes, [&](Bytes of, Bytes content) {
    if (of == type) found = content;
    return of == type;
  });
  return found;
}

std::string ReadMovieBox(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  uint64_t at = 0;
  for (int i = 0; i < kMaxBoxes; ++i) {
    std::string head(16, '\0');
    file.seekg(static_cast<std::streamoff>(at));
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    if (file.gcount() < 8) return "";
    file.clear();
    const uint64_t declared = BoxNumber(head, 0, 4);
    const uint64_t header = declared == 1 ? 16 : 8;
    const uint64_t size = declared == 1 ? BoxNumber(head, 8, 8) : declared;
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

std::string_view FirstVideoTrack(std::string_view movie) {
  Bytes found;
  ForEachBox(movie, [&](Bytes type, Bytes content) {
    if (type != "trak") return false;
    const Bytes handler = Box(Box(content, "mdia"), "hdlr");
    if (handler.size() < 12 || handler.substr(8, 4) != "vide") return false;
    found = content;
    return true;
  });
  return found;
}

std::string_view SampleTable(std::string_view track) {
  return Box(Box(Box(track, "mdia"), "minf"), "stbl");
}

MovieSize ReadMovieSize(const std::filesystem::path& path) {
  const std::string movie = ReadMovieBox(path);
  const Bytes track = FirstVideoTrack(movie);
  MovieSize size;
  // After version, flags and the common size of the samples.
  const Bytes sizes = Box(SampleTable(track), "stsz");
  size.num_frames = static_cast<int64_t>(BoxNumber(sizes, 8, 4));
  // Width and height are 16.16 fixed-point numbers at the end of the track header.
  const Bytes header = Box(track, "tkhd");
  if (header.size() < 8) return size;
  size.width = static_cast<int>(BoxNumber(header, header.size() - 8, 2));
  size.height = static_cast<int>(BoxNumber(header, header.size() - 4, 2));
  return size;
}

}  // namespace pepeseg
