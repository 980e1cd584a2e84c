#include "core/dataset/depth_files.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

PEPESEG_FUZZ_TARGET(depth_pfm) {
  static pepeseg::fuzz::MemoryFile file;
  const auto image = pepeseg::ParsePfm("a.pfm", bytes);
  if (image.ok()) {
    const auto pixels = static_cast<size_t>(image->width) * static_cast<size_t>(image->height);
    pepeseg::fuzz::Expect(image->values.size() == pixels && 4 * pixels <= bytes.size(),
                          "a value for each pixel, of bytes that are there");
  }
  for (const auto kind :
       {pepeseg::DepthPrior::Kind::kDepth, pepeseg::DepthPrior::Kind::kDisparity}) {
    (void)pepeseg::ReadDepthMap(file.Put(bytes), "a.pfm", kind, {"a.jpg", 4, 3});
  }
}
