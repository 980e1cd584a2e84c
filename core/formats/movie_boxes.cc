#include "core/formats/movie_boxes.h"

#include <fstream>

namespace pepeseg {
namespace {

using Bytes = std::string_view;

constexpr uint64_t kMaxHeaderBytes = 64 << 20;
constexpr int kMaxBoxes = 4096;  // at the top of a file; fragmented files have many

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

void ForEachBox(Bytes bytes, absl::FunctionRef<bool(Bytes, Bytes)> use) {
  constexpr size_t kHeader = 8;
  while (bytes.size() >= kHeader) {
    const uint64_t declared = BoxNumber(bytes, 0, 4);
    const uint64_t size = declared == 0 ? bytes.size() : declared;
    if (size < kHeader || size > bytes.size()) return;  // boxes of 64-bit sizes hold only samples
    if (use(bytes.substr(4, 4), bytes.substr(kHeader, size - kHeader))) return;
    bytes.remove_prefix(size);
  }
}

void ForEachFileBox(const std::filesystem::path& path, Bytes type,
                    absl::FunctionRef<bool(Bytes)> use) {
  std::ifstream file(path, std::ios::binary);
  uint64_t at = 0;
  for (int i = 0; i < kMaxBoxes; ++i) {
    std::string head(16, '\0');
    file.seekg(static_cast<std::streamoff>(at));
    file.read(head.data(), static_cast<std::streamsize>(head.size()));
    if (file.gcount() < 8) return;
    file.clear();
    const uint64_t declared = BoxNumber(head, 0, 4);
    const uint64_t header = declared == 1 ? 16 : 8;
    const uint64_t size = declared == 1 ? BoxNumber(head, 8, 8) : declared;
    // A size of 0 means up to the end of the file, which only samples have.
    if (size < header || size > uint64_t{1} << 62) return;
    if (Bytes(head).substr(4, 4) == type) {
      if (size - header > kMaxHeaderBytes) return;
      std::string content(size - header, '\0');
      file.seekg(static_cast<std::streamoff>(at + header));
      file.read(content.data(), static_cast<std::streamsize>(content.size()));
      content.resize(static_cast<size_t>(file.gcount()));
      file.clear();
      if (use(content)) return;
    }
    at += size;
    if (at > uint64_t{1} << 62) return;
  }
}

std::string ReadMovieBox(const std::filesystem::path& path) {
  std::string movie;
  ForEachFileBox(path, "moov", [&](Bytes content) {
    movie = content;
    return true;
  });
  return movie;
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

}  // namespace pepeseg
