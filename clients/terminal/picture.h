#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Images in memory: decoding, encoding, resizing, and drawing on them.
namespace pepeseg::client::cli {

struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
};

struct PixelSize {
  int width = 0, height = 0;

  bool operator==(const PixelSize&) const = default;
};

// A position in pixels: the centre of the first pixel is at (0.5, 0.5).
struct OutlinePoint {
  double x = 0, y = 0;
};

using Polygon = std::vector<OutlinePoint>;

// An RGB image, [height, width, 3], 8 bits.
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

// A grey image, [height, width], 8 bits: a label image or a mask.
struct GreyPicture {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;
};

// A grey image, [height, width], 16 bits: ids, or depth in steps of RenderViewResponse.depth_unit.
struct Grey16Picture {
  int width = 0;
  int height = 0;
  std::vector<uint16_t> pixels;
};

// Read or decode JPEG and PNG; channels are converted. LocalFileError: the file cannot be read.
// INVALID_ARGUMENT: it is not an image, or a side exceeds 16384 pixels. `name` is for errors.
absl::StatusOr<Picture> ReadPicture(const std::filesystem::path& path);
absl::StatusOr<GreyPicture> ReadGreyPicture(const std::filesystem::path& path);
absl::StatusOr<Picture> DecodePicture(absl::string_view bytes, absl::string_view name);
// Decodes a PNG; INVALID_ARGUMENT also if it is not grey with 16 bits.
absl::StatusOr<Grey16Picture> DecodeGrey16(absl::string_view bytes, absl::string_view name);

// Write a PNG, as WriteFile does.
absl::Status WritePng(const std::filesystem::path& path, const Picture& picture);
absl::Status WritePng(const std::filesystem::path& path, const GreyPicture& picture);
// Returns a grey PNG of 8 bits with the values of the image.
std::string EncodePng(const GreyPicture& picture);

// Resize by nearest neighbour, which keeps label values.
GreyPicture Resized(const GreyPicture& picture, int width, int height);
Picture Resized(const Picture& picture, int width, int height);

// Tints the pixels of a mask (non-zero), and draws its border in the full colour. The mask has the
// picture's size.
void DrawMask(Picture& picture, std::span<const uint8_t> mask, Rgb color);
// Draws only the border of a mask.
void DrawOutline(Picture& picture, std::span<const uint8_t> mask, Rgb color);
// Draws a ring with dark rims around a position, pixels.
void DrawClick(Picture& picture, double x, double y, Rgb color);
// Draws text with its top left corner at a pixel.
void DrawText(Picture& picture, int x, int y, absl::string_view text, Rgb color);

struct Panel {
  std::string caption;
  Picture picture;
};
// Returns one picture with the panels, which have one size, from left to right, and a caption above
// each. There is at least one.
Picture SideBySide(std::span<const Panel> panels);

}  // namespace pepeseg::client::cli
