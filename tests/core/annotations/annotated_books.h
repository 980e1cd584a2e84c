#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/annotations/annotation_writer.h"
#include "core/formats/rle.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/unzipped.h"

namespace pepeseg {

// Two mugs and a book with a hole in two photographs of 6 x 4 pixels; the second mug is in the
// second one only.
struct AnnotatedBooks {
  static constexpr RasterSize kSize{6, 4};

  // Returns a mask with the pixels of a box, and a hole of one pixel in large ones.
  static BinaryMask BoxMask(int x, int y, int width, int height) {
    BinaryMask mask{std::vector<uint8_t>(size_t{24}, 0)};
    for (int v = y; v < y + height; ++v) {
      for (int u = x; u < x + width; ++u) mask.pixels[static_cast<size_t>(v) * 6 + u] = 1;
    }
    if (width > 2 && height > 2) mask.pixels[static_cast<size_t>(y + 1) * 6 + x + 1] = 0;
    return mask;
  }

  // Returns the files of a format by name.
  std::map<std::string, std::string> Write(AnnotationFormat format) const {
    ZipWriter zip;
    const auto writer = MakeAnnotationWriter(format, scene, zip);
    for (size_t v = 0; v < masks.size(); ++v) {
      AnnotatedView view{v, kSize, {}};
      for (const BinaryMask& mask : masks[v]) view.counts.push_back(EncodeCocoRle(mask, 6, 4));
      EXPECT_OK(writer->Add(view));
    }
    EXPECT_OK(writer->Finish());
    const auto bytes = std::move(zip).Finish();
    EXPECT_OK(bytes.status());
    return bytes.ok() ? testing::Unzipped(*bytes) : std::map<std::string, std::string>();
  }

  AnnotatedScene scene = {"scenes/shelf",
                          ThingsOf(std::vector<LabelText>{
                              {"book", "Book & \"<pen>\""}, {"mug", "mug.2"}, {"mug-2", "mug"}}),
                          {"cam0/a.jpg", "cam0/b.jpg"}};
  std::vector<std::vector<BinaryMask>> masks = {
      {BoxMask(0, 0, 4, 4), BoxMask(4, 1, 2, 2), BoxMask(0, 0, 0, 0)},
      {BoxMask(0, 0, 0, 0), BoxMask(1, 1, 3, 3), BoxMask(3, 0, 1, 4)}};
};

}  // namespace pepeseg
