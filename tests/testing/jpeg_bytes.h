#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

// Needs <cstdio>.
#include <jpeglib.h>

#include "core/scene/capture.h"

namespace pepeseg::testing {

// Returns a JPEG whose channels are stored as they are. Link with jpeg.
inline std::string StoredJpeg(const Image& image, J_COLOR_SPACE space, bool progressive) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &bytes, &size);
  info.image_width = static_cast<JDIMENSION>(image.width);
  info.image_height = static_cast<JDIMENSION>(image.height);
  info.input_components = image.channels;
  info.in_color_space = space;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 100, TRUE);
  if (progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  std::vector<uint8_t> pixels = image.pixels;
  for (int y = 0; y < image.height; ++y) {
    JSAMPROW row = &pixels[static_cast<size_t>(y) * image.width * image.channels];
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  std::string jpeg(reinterpret_cast<const char*>(bytes), size);
  jpeg_destroy_compress(&info);
  std::free(bytes);
  return jpeg;
}

}  // namespace pepeseg::testing
