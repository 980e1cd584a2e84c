#include "core/formats/encode_webp.h"

#include <webp/encode.h>

#include <cassert>
#include <memory>
#include <new>

namespace pepeseg {

std::string EncodeLosslessWebp(std::span<const uint8_t> pixels, int width, int height) {
  assert(width > 0 && width <= WEBP_MAX_DIMENSION && height > 0 && height <= WEBP_MAX_DIMENSION);
  assert(pixels.size() == size_t{4} * static_cast<size_t>(width) * static_cast<size_t>(height));
  constexpr int kLevel = 2;  // of 9. Higher ones take longer, and save hundredths of noise
  WebPConfig config;
  if (!WebPConfigInit(&config) || !WebPConfigLosslessPreset(&config, kLevel)) {
    throw std::bad_alloc();  // the version is another than that of the header: it is checked
  }
  config.exact = 1;  // else colours of transparent pixels are changed

  WebPPicture picture;
  WebPPictureInit(&picture);
  const std::unique_ptr<WebPPicture, decltype(&WebPPictureFree)> freed(&picture, &WebPPictureFree);
  picture.use_argb = 1;
  picture.width = width;
  picture.height = height;
  std::string bytes;
  picture.custom_ptr = &bytes;
  picture.writer = [](const uint8_t* data, size_t size, const WebPPicture* to) {
    static_cast<std::string*>(to->custom_ptr)->append(reinterpret_cast<const char*>(data), size);
    return 1;
  };
  // Sizes and parameters are valid: the calls fail without memory only, which new reports.
  if (!WebPPictureImportRGBA(&picture, pixels.data(), 4 * width) ||
      !WebPEncode(&config, &picture)) {
    throw std::bad_alloc();
  }
  return bytes;
}

}  // namespace pepeseg
