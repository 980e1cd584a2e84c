#include "core/formats/decode_luma.h"

#include <csetjmp>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

// Needs <cstdio>.
#include <jpeglib.h>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"

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
void AppendLuma(const std::vector<uint8_t>& scanline, int channels, std::vector<uint8_t>& luma) {
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

// Decodes one JPEG by libjpeg, whose errors end in Fail, which jumps back to Decode. Nothing with a
// destructor is made between the two.
class JpegDecoder {
 public:
  JpegDecoder() {
    info_.err = jpeg_std_error(&errors_);
    info_.client_data = this;
    errors_.error_exit = Fail;
    // Ignores warnings: a damaged file that still gives a picture is accepted, as by DecodePhoto.
    errors_.emit_message = [](j_common_ptr, int) {};
  }
  ~JpegDecoder() { jpeg_destroy_decompress(&info_); }
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  // Decodes the JPEG, whose size is known, to `luma`. Returns whether it succeeded; if not,
  // message() says why.
  bool Decode(std::span<const uint8_t> bytes, Image& luma);
  const char* message() const { return message_; }

 private:
  [[noreturn]] static void Fail(j_common_ptr info) {
    auto* decoder = static_cast<JpegDecoder*>(info->client_data);
    info->err->format_message(info, decoder->message_);
    std::longjmp(decoder->before_, 1);
  }
  bool Refuse(const char* why) {
    std::snprintf(message_, sizeof(message_), "%s", why);
    return false;
  }

  jpeg_decompress_struct info_{};
  jpeg_error_mgr errors_{};
  std::jmp_buf before_{};
  char message_[JMSG_LENGTH_MAX] = {};
  std::vector<uint8_t> scanline_;
};

bool JpegDecoder::Decode(std::span<const uint8_t> bytes, Image& luma) {
  if (setjmp(before_) != 0) return false;
  jpeg_create_decompress(&info_);
  jpeg_mem_src(&info_, bytes.data(), bytes.size());
  jpeg_read_header(&info_, TRUE);
  info_.dct_method = JDCT_IFAST;
  info_.do_fancy_upsampling = FALSE;
  jpeg_start_decompress(&info_);
  const int channels = info_.output_components;
  if (channels != 1 && channels != 3 && channels != 4) return Refuse("not grey, RGB or CMYK");
  if (static_cast<int64_t>(info_.output_width) != luma.width ||
      static_cast<int64_t>(info_.output_height) != luma.height) {
    return Refuse("it decodes to another size than its header says");
  }
  luma.pixels.reserve(static_cast<size_t>(luma.width) * luma.height);
  scanline_.resize(static_cast<size_t>(luma.width) * channels);
  while (info_.output_scanline < info_.output_height) {
    JSAMPROW row = scanline_.data();
    jpeg_read_scanlines(&info_, &row, 1);
    AppendLuma(scanline_, channels, luma.pixels);
  }
  jpeg_finish_decompress(&info_);
  return true;
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
  JpegDecoder decoder;
  if (decoder.Decode(bytes, luma)) return luma;
  return Refused(name, absl::StrCat("does not decode: ", decoder.message()));
}

Image LumaOf(Image image) {
  if (image.channels == 1) return image;
  Image luma{image.width, image.height, 1, {}};
  luma.pixels.reserve(static_cast<size_t>(image.width) * image.height);
  AppendLuma(image.pixels, image.channels, luma.pixels);
  return luma;
}

}  // namespace pepeseg
