#include "core/formats/rle.h"
#include "tests/system/fuzz/fuzz_target.h"

// The first two bytes are width and height.
PEPESEG_FUZZ_TARGET(coco_rle) {
  if (bytes.size() < 2) return;
  const int width = static_cast<uint8_t>(bytes[0]), height = static_cast<uint8_t>(bytes[1]);
  const auto counts = pepeseg::ParseCocoCounts(bytes.substr(2));
  if (!counts.ok()) return;
  const auto pixels = pepeseg::PixelsOfRuns(*counts, width, height);
  if (!pixels.ok()) return;
  pepeseg::BinaryMask mask{std::vector<uint8_t>(static_cast<size_t>(width) * height)};
  for (const uint32_t pixel : *pixels) mask.pixels.at(pixel) = 1;
  // Writes the same pixels, and reads them again.
  const auto again = pepeseg::ParseCocoCounts(pepeseg::EncodeCocoRle(mask, width, height));
  pepeseg::fuzz::Expect(again.ok(), "our own runs to be read");
  const auto same = pepeseg::PixelsOfRuns(*again, width, height);
  pepeseg::fuzz::Expect(same.ok() && *same == *pixels, "the same pixels again");
}
