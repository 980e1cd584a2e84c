#include "clients/terminal/picture.h"

#include <stb_easy_font.h>
#include <stb_image.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/png_bytes.h"

namespace pepeseg::client::cli {
namespace {

constexpr int kMaxSide = 16384;  // pixels; a larger picture is refused

using StbPixels = std::unique_ptr<stbi_uc, void (*)(void*)>;

const stbi_uc* Data(absl::string_view bytes) {
  return reinterpret_cast<const stbi_uc*>(bytes.data());
}
int Size(absl::string_view bytes) {
  return static_cast<int>(std::min<size_t>(bytes.size(), INT32_MAX));
}

struct Decoded {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;
};

// Reads the header: sets the size of `image` and returns the number of channels. INVALID_ARGUMENT:
// it is not an image, or too large.
absl::StatusOr<int> CheckHead(absl::string_view bytes, absl::string_view name, Decoded& image) {
  int in_file = 0;
  if (stbi_info_from_memory(Data(bytes), Size(bytes), &image.width, &image.height, &in_file) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": is neither a JPEG nor a PNG"));
  }
  if (image.width > kMaxSide || image.height > kMaxSide) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", image.width, "x", image.height,
                                                   " pixels exceed the limit of ", kMaxSide,
                                                   " a side"));
  }
  return in_file;
}

// Decodes an image to `channels`, 1 or 3, however many the file has.
absl::StatusOr<Decoded> Decode(absl::string_view bytes, absl::string_view name, int channels) {
  Decoded image;
  ASSIGN_OR_RETURN(int in_file, CheckHead(bytes, name, image));
  const StbPixels pixels(stbi_load_from_memory(Data(bytes), Size(bytes), &image.width,
                                               &image.height, &in_file, channels),
                         stbi_image_free);
  if (pixels == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", stbi_failure_reason()));
  }
  const size_t count = static_cast<size_t>(image.width) * image.height * channels;
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

absl::Status WritePngBytes(const std::filesystem::path& path, int width, int height,
                           std::span<const uint8_t> pixels) {
  const int channels = static_cast<int>(pixels.size() / (static_cast<size_t>(width) * height));
  const std::string png = PngBytes(width, height, channels, pixels);
  if (png.empty()) {
    return absl::InternalError(
        absl::StrCat(path.string(), ": ", width, "x", height, " pixels cannot be encoded"));
  }
  return WriteFile(path, png);
}

// Returns the source coordinate of a resized pixel: the one nearest to its centre.
int SourceAt(int at, int size, int source_size) {
  return std::min(source_size - 1, static_cast<int>((at + 0.5) * source_size / size));
}

constexpr int kTextScale = 2;     // screen pixels a font pixel
constexpr int kCaptionRows = 28;  // pixels above a panel
constexpr int kGap = 8;           // pixels between panels
constexpr Rgb kPaper{250, 250, 248};
constexpr Rgb kInk{40, 40, 40};

// Sets a pixel; does nothing outside the picture.
void Put(Picture& picture, int x, int y, Rgb color) {
  if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) return;
  uint8_t* pixel = picture.At(x, y);
  pixel[0] = color.r;
  pixel[1] = color.g;
  pixel[2] = color.b;
}

// Returns true for a pixel inside the mask that has a neighbour outside the mask or the picture.
bool OnBorder(const Picture& picture, std::span<const uint8_t> mask, int x, int y) {
  const auto inside = [&](int u, int v) {
    return u >= 0 && v >= 0 && u < picture.width && v < picture.height &&
           mask[static_cast<size_t>(v) * picture.width + u] != 0;
  };
  return inside(x, y) &&
         !(inside(x - 1, y) && inside(x + 1, y) && inside(x, y - 1) && inside(x, y + 1));
}

// Blends `share` of `color` into a pixel.
void Mix(uint8_t* pixel, Rgb color, double share) {
  const std::array<uint8_t, 3> target = {color.r, color.g, color.b};
  for (int c = 0; c < 3; ++c) {
    pixel[c] = static_cast<uint8_t>(std::lround(pixel[c] * (1 - share) + target[c] * share));
  }
}

}  // namespace

Picture Picture::Filled(int width, int height, Rgb color) {
  Picture picture{width, height, std::vector<uint8_t>(static_cast<size_t>(width) * height * 3)};
  for (size_t i = 0; i < picture.pixels.size(); i += 3) {
    picture.pixels[i] = color.r;
    picture.pixels[i + 1] = color.g;
    picture.pixels[i + 2] = color.b;
  }
  return picture;
}

absl::StatusOr<Picture> DecodePicture(absl::string_view bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(Decoded image, Decode(bytes, name, 3));
  return Picture{image.width, image.height, std::move(image.pixels)};
}

absl::StatusOr<Grey16Picture> DecodeGrey16(absl::string_view bytes, absl::string_view name) {
  Decoded head;
  ASSIGN_OR_RETURN(int channels, CheckHead(bytes, name, head));
  if (channels != 1 || stbi_is_16_bit_from_memory(Data(bytes), Size(bytes)) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": not grey of 16 bits"));
  }
  const std::unique_ptr<stbi_us, void (*)(void*)> pixels(
      stbi_load_16_from_memory(Data(bytes), Size(bytes), &head.width, &head.height, &channels, 1),
      stbi_image_free);
  if (pixels == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", stbi_failure_reason()));
  }
  const size_t count = static_cast<size_t>(head.width) * head.height;
  return Grey16Picture{head.width, head.height, {pixels.get(), pixels.get() + count}};
}

absl::StatusOr<Picture> ReadPicture(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return DecodePicture(bytes, path.string());
}

absl::StatusOr<GreyPicture> ReadGreyPicture(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  ASSIGN_OR_RETURN(Decoded image, Decode(bytes, path.string(), 1));
  return GreyPicture{image.width, image.height, std::move(image.pixels)};
}

absl::Status WritePng(const std::filesystem::path& path, const Picture& picture) {
  return WritePngBytes(path, picture.width, picture.height, picture.pixels);
}

absl::Status WritePng(const std::filesystem::path& path, const GreyPicture& picture) {
  return WritePngBytes(path, picture.width, picture.height, picture.pixels);
}

std::string EncodePng(const GreyPicture& picture) {
  return PngBytes(picture.width, picture.height, 1, picture.pixels);
}

GreyPicture Resized(const GreyPicture& picture, int width, int height) {
  GreyPicture result{width, height, {}};
  result.pixels.reserve(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    const size_t row = static_cast<size_t>(SourceAt(y, height, picture.height)) * picture.width;
    for (int x = 0; x < width; ++x) {
      result.pixels.push_back(picture.pixels[row + SourceAt(x, width, picture.width)]);
    }
  }
  return result;
}

Picture Resized(const Picture& picture, int width, int height) {
  Picture result = Picture::Filled(width, height, {});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const uint8_t* from =
          picture.At(SourceAt(x, width, picture.width), SourceAt(y, height, picture.height));
      std::copy(from, from + 3, result.At(x, y));
    }
  }
  return result;
}

void DrawMask(Picture& picture, std::span<const uint8_t> mask, Rgb color) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (mask[static_cast<size_t>(y) * picture.width + x] == 0) continue;
      Mix(picture.At(x, y), color, OnBorder(picture, mask, x, y) ? 1.0 : 0.45);
    }
  }
}

void DrawOutline(Picture& picture, std::span<const uint8_t> mask, Rgb color) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      if (OnBorder(picture, mask, x, y)) Put(picture, x, y, color);
    }
  }
}

void DrawClick(Picture& picture, double x, double y, Rgb color) {
  constexpr double kRadius = 7;
  for (int dy = -10; dy <= 10; ++dy) {
    for (int dx = -10; dx <= 10; ++dx) {
      const double off = std::abs(std::hypot(dx, dy) - kRadius);
      const auto at_x = static_cast<int>(x) + dx;
      const auto at_y = static_cast<int>(y) + dy;
      if (off < 1.2) Put(picture, at_x, at_y, color);
      if (off >= 1.2 && off < 2.2) Put(picture, at_x, at_y, kInk);
    }
  }
}

void DrawText(Picture& picture, int x, int y, absl::string_view text, Rgb color) {
  struct Vertex {  // the layout of stb_easy_font
    float x, y, z;
    uint8_t rgba[4];
  };
  std::string line(text);
  // Room for 24 quads of 4 vertices a character.
  std::vector<Vertex> vertices(line.size() * 4 * 24 + 4);
  const int quads = stb_easy_font_print(0, 0, line.data(), nullptr, vertices.data(),
                                        static_cast<int>(vertices.size() * sizeof(Vertex)));
  for (int quad = 0; quad < quads;
       ++quad) {  // an axis-aligned rectangle with opposite corners 0 and 2
    const Vertex& from = vertices[4 * quad];
    const Vertex& to = vertices[4 * quad + 2];
    for (int v = static_cast<int>(from.y * kTextScale); v < to.y * kTextScale; ++v) {
      for (int u = static_cast<int>(from.x * kTextScale); u < to.x * kTextScale; ++u) {
        Put(picture, x + u, y + v, color);
      }
    }
  }
}

Picture SideBySide(std::span<const Panel> panels) {
  const Picture& first = panels.front().picture;
  const int count = static_cast<int>(panels.size());
  Picture sheet = Picture::Filled(count * first.width + (count - 1) * kGap,
                                  first.height + kCaptionRows, kPaper);
  for (int i = 0; i < count; ++i) {
    const int left = i * (first.width + kGap);
    DrawText(sheet, left + 4, 6, panels[i].caption, kInk);
    for (int y = 0; y < first.height; ++y) {
      const uint8_t* row = panels[i].picture.At(0, y);
      std::copy(row, row + static_cast<size_t>(first.width) * 3, sheet.At(left, y + kCaptionRows));
    }
  }
  return sheet;
}

}  // namespace pepeseg::client::cli
