#include "core/formats/jpeg_file.h"

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <vector>

// Needs <cstdio>.
#include <jpeglib.h>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"

namespace pepeseg {
namespace {

// Handles libjpeg's errors, which end in Fail: it keeps the message and jumps to `before`. Nothing
// with a destructor may be made between setjmp() and a call of libjpeg.
struct JpegErrors {
  explicit JpegErrors(jpeg_common_struct& info) {
    info.err = jpeg_std_error(&manager);
    info.client_data = this;
    manager.error_exit = Fail;
    // Ignores warnings: a damaged file that still gives a picture is accepted.
    manager.emit_message = [](j_common_ptr, int) {};
  }
  [[noreturn]] static void Fail(j_common_ptr info) {
    auto* errors = static_cast<JpegErrors*>(info->client_data);
    info->err->format_message(info, errors->message);
    std::longjmp(errors->before, 1);
  }

  jpeg_error_mgr manager{};
  std::jmp_buf before{};
  char message[JMSG_LENGTH_MAX] = {};
};

class JpegReader {
 public:
  JpegReader() : errors_(reinterpret_cast<jpeg_common_struct&>(info_)) {}
  ~JpegReader() { jpeg_destroy_decompress(&info_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  // Returns whether it succeeded; if not, message() says why.
  bool ReadHeader(std::span<const uint8_t> bytes);
  bool ReadRows(JpegDecoding how, JpegRowFn take);

  int64_t width() const { return info_.image_width; }
  int64_t height() const { return info_.image_height; }
  const char* message() const { return errors_.message; }

 private:
  jpeg_decompress_struct info_{};
  JpegErrors errors_;
  std::vector<uint8_t> scanline_;
};

bool JpegReader::ReadHeader(std::span<const uint8_t> bytes) {
  if (setjmp(errors_.before) != 0) return false;
  jpeg_create_decompress(&info_);
  jpeg_mem_src(&info_, bytes.data(), bytes.size());
  return jpeg_read_header(&info_, TRUE) == JPEG_HEADER_OK;
}

bool JpegReader::ReadRows(JpegDecoding how, JpegRowFn take) {
  if (setjmp(errors_.before) != 0) return false;
  if (how == JpegDecoding::kFast) {
    info_.dct_method = JDCT_IFAST;
    info_.do_fancy_upsampling = FALSE;
  }
  jpeg_start_decompress(&info_);
  const int channels = info_.output_components;
  if (channels != 1 && channels != 3 && channels != 4) {
    std::snprintf(errors_.message, sizeof(errors_.message), "not grey, RGB or CMYK");
    return false;
  }
  scanline_.resize(static_cast<size_t>(info_.output_width) * channels);
  while (info_.output_scanline < info_.output_height) {
    JSAMPROW row = scanline_.data();
    jpeg_read_scanlines(&info_, &row, 1);
    take(scanline_, channels);
  }
  // The picture is complete: what follows it in the file is not read.
  return true;
}

class JpegWriter {
 public:
  JpegWriter() : errors_(reinterpret_cast<jpeg_common_struct&>(info_)) {}
  ~JpegWriter() {
    jpeg_destroy_compress(&info_);
    std::free(bytes_);
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;

  bool Write(const Image& image, int quality);
  std::string bytes() const { return {reinterpret_cast<const char*>(bytes_), size_}; }
  const char* message() const { return errors_.message; }

 private:
  jpeg_compress_struct info_{};
  JpegErrors errors_;
  unsigned char* bytes_ = nullptr;  // allocated by libjpeg
  unsigned long size_ = 0;
};

bool JpegWriter::Write(const Image& image, int quality) {
  if (setjmp(errors_.before) != 0) return false;
  jpeg_create_compress(&info_);
  jpeg_mem_dest(&info_, &bytes_, &size_);
  info_.image_width = static_cast<JDIMENSION>(image.width);
  info_.image_height = static_cast<JDIMENSION>(image.height);
  info_.input_components = image.channels;
  info_.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info_);
  jpeg_set_quality(&info_, quality, /*force_baseline=*/TRUE);
  jpeg_start_compress(&info_, TRUE);
  while (info_.next_scanline < info_.image_height) {
    // libjpeg only reads the row, but has no type for that.
    auto* row = const_cast<JSAMPLE*>(image.pixels.data()) +
                static_cast<size_t>(info_.next_scanline) * image.width * image.channels;
    jpeg_write_scanlines(&info_, &row, 1);
  }
  jpeg_finish_compress(&info_);
  return true;
}

}  // namespace

absl::Status DecodeJpeg(std::span<const uint8_t> bytes, const ImageHeader& header,
                        absl::string_view name, JpegDecoding how, JpegRowFn take) {
  JpegReader reader;
  if (!reader.ReadHeader(bytes)) {
    return Refused(name, absl::StrCat("does not decode: ", reader.message()));
  }
  // Compared before libjpeg allocates anything for the pixels.
  if (reader.width() != header.width || reader.height() != header.height) {
    return Refused(name, absl::StrCat("its header says ", header.width, "x", header.height,
                                      ", it decodes to ", reader.width(), "x", reader.height()));
  }
  if (reader.ReadRows(how, take)) return absl::OkStatus();
  return Refused(name, absl::StrCat("does not decode: ", reader.message()));
}

absl::StatusOr<std::string> JpegBytes(const Image& image, int quality) {
  JpegWriter writer;
  if (writer.Write(image, quality)) return writer.bytes();
  return absl::InternalError(absl::StrCat("cannot encode an image: ", writer.message()));
}

}  // namespace pepeseg
