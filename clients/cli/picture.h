#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace pepeseg::client::cli {

struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
};

// [height, width, 3], 8 bits.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;

  static Picture Filled(int width, int height, Rgb color);
  uint8_t* At(int x, int y) { return &pixels[(static_cast<size_t>(y) * width + x) * 3]; }
  const uint8_t* At(int x, int y) const {
    return &pixels[(static_cast<size_t>(y) * width + x) * 3];
  }
};

// [height, width], one value a pixel: a label image or a mask.
struct GreyPicture {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;
};

// [height, width], 16 bits: ids or steps of depth.
struct Grey16Picture {
  int width = 0;
  int height = 0;
  std::vector<uint16_t> pixels;
};

// JPEG and PNG. NOT_FOUND or INVALID_ARGUMENT naming the file.
absl::StatusOr<Picture> ReadPicture(const std::filesystem::path& path);
absl::StatusOr<GreyPicture> ReadGreyPicture(const std::filesystem::path& path);
absl::StatusOr<Picture> DecodePicture(absl::string_view bytes, absl::string_view name);
// INVALID_ARGUMENT too for a picture that is not of 16 bits grey.
absl::StatusOr<Grey16Picture> DecodeGrey16(absl::string_view bytes, absl::string_view name);

absl::Status WritePng(const std::filesystem::path& path, const Picture& picture);
absl::Status WritePng(const std::filesystem::path& path, const GreyPicture& picture);
// 8 bits, the values as they are.
std::string EncodePng(const GreyPicture& picture);

// Nearest neighbour: keeps label values.
GreyPicture Resized(const GreyPicture& picture, int width, int height);
Picture Resized(const Picture& picture, int width, int height);

// Tints the mask (non-zero) and draws its border in the full colour.
void DrawMask(Picture& picture, std::span<const uint8_t> mask, Rgb color);
// A border only, of the other side's opinion.
void DrawOutline(Picture& picture, std::span<const uint8_t> mask, Rgb color);
// A ring around a pixel.
void DrawClick(Picture& picture, double x, double y, Rgb color);
void DrawText(Picture& picture, int x, int y, absl::string_view text, Rgb color);

struct Panel {
  std::string caption;
  Picture picture;
};
// Panels of one size from left to right, a caption above each.
Picture SideBySide(std::span<const Panel> panels);

}  // namespace pepeseg::client::cli
