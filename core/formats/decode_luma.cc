#include "core/formats/decode_luma.h"

#include <string>
#include <utility>
#include <vector>

#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/jpeg_file.h"

namespace pepeseg {
namespace {

// Rounds as FreeImage does.
uint8_t Luma(int red, int green, int blue) {
  const float raised = 0.2126f * static_cast<float>(red) + 0.7152f * static_cast<float>(green) +
                       0.0722f * static_cast<float>(blue) + 0.5f;
  return static_cast<uint8_t>(raised);
}

// Appends the luma of a scanline of libjpeg: grey, RGB or inverted CMYK, as Adobe's programs write
// it and FreeImage takes it.
void AppendLuma(std::span<const uint8_t> scanline, int channels, std::vector<uint8_t>& luma) {
  if (channels == 1) luma.insert(luma.end(), scanline.begin(), scanline.end());
  for (size_t i = 0; channels == 3 && i < scanline.size(); i += 3) {
    luma.push_back(Luma(scanline[i], scanline[i + 1], scanline[i + 2]));
  }
  for (size_t i = 0; channels == 4 && i < scanline.size(); i += 4) {
    const int black = scanline[i + 3];
    luma.push_back(Luma(scanline[i] * black / 255, scanline[i + 1] * black / 255,
                        scanline[i + 2] * black / 255));
  }
}

}  // namespace

absl::StatusOr<Image> DecodeLuma(const std::filesystem::path& path, absl::string_view name) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxImageFileBytes));
  return DecodeLuma(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()), name);
}

absl::StatusOr<Image> DecodeLuma(std::span<const uint8_t> bytes, absl::string_view name) {
  // Refuses files that are too large or cut short before anything is allocated for them.
  ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(name, bytes));
  if (header.format != ImageFormat::kJpeg) {
    ASSIGN_OR_RETURN(Image image, DecodePhoto(bytes, name));
    return LumaOf(std::move(image));
  }
  Image luma{header.width, header.height, 1, {}};
  const auto take = [&luma](std::span<const uint8_t> scanline, int channels) {
    // Here and not before, so that a file without pixels takes no memory.
    luma.pixels.reserve(static_cast<size_t>(luma.width) * luma.height);
    AppendLuma(scanline, channels, luma.pixels);
  };
  RETURN_IF_ERROR(DecodeJpeg(bytes, header, name, JpegDecoding::kFast, take));
  return luma;
}

Image LumaOf(Image image) {
  if (image.channels == 1) return image;
  Image luma{image.width, image.height, 1, {}};
  luma.pixels.reserve(static_cast<size_t>(image.width) * image.height);
  AppendLuma(image.pixels, image.channels, luma.pixels);
  return luma;
}

}  // namespace pepeseg
