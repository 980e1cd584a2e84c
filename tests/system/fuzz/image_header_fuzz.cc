#include "core/formats/exif.h"
#include "core/formats/image_header.h"
#include "tests/system/fuzz/fuzz_target.h"

PEPESEG_FUZZ_TARGET(image_header) {
  const std::span raw(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  (void)pepeseg::ReadExifCamera(raw);
  const auto header = pepeseg::ReadImageHeader("a.jpg", raw);
  if (!header.ok()) return;
  pepeseg::fuzz::Expect(header->width > 0 && header->height > 0, "a size");
  pepeseg::fuzz::Expect(int64_t{header->width} * header->height <= pepeseg::kMaxImagePixels,
                        "a size within the limit");
}
