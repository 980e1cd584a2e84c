#include "core/formats/decode_luma.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

// Debian's libjpeg, libpng and libwebp have no instrumentation for coverage. The target checks the
// decoded image.
PEPESEG_FUZZ_TARGET(decode_image) {
  static pepeseg::fuzz::MemoryFile file;
  const std::span raw(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  const auto header = pepeseg::ReadImageHeader("a.jpg", raw);
  // Large images are slow and find nothing new.
  if (header.ok() && header->width * header->height > 1 << 16) return;
  const std::string& path = file.Put(bytes);
  const auto photo = pepeseg::DecodePhoto(path, "a.jpg");
  if (photo.ok()) {
    pepeseg::fuzz::Expect(header.ok() && photo->width == header->width, "the header's width");
  }
  const auto luma = pepeseg::DecodeLuma(path, "a.jpg");
  if (luma.ok()) {
    pepeseg::fuzz::Expect(header.ok() && luma->width == header->width, "the header's width");
  }
  (void)pepeseg::DecodeLabels(path, "a.png");
  (void)pepeseg::DecodeGrey(path, "a.png");
}
