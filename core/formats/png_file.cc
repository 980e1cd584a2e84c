#include "core/formats/png_file.h"

#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstdio>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"

namespace pepeseg {
namespace {

constexpr bool kLittleEndian = std::endian::native == std::endian::little;

// Message of libpng's last error.
struct PngErrors {
  char message[128] = {};
};

// Called by libpng. Nothing with a destructor may be made between setjmp() and a call of libpng.
[[noreturn]] void Fail(png_structp png, png_const_charp message) {
  auto* errors = static_cast<PngErrors*>(png_get_error_ptr(png));
  std::snprintf(errors->message, sizeof(errors->message), "%s", message);
  png_longjmp(png, 1);
}

// A damaged file that still gives a picture is accepted.
void Ignore(png_structp, png_const_charp) {}

class PngReader {
 public:
  explicit PngReader(std::span<const uint8_t> bytes) : rest_(bytes) {}
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  // Returns whether it succeeded; if not, message() says why.
  bool Read(const ImageHeader& header, PngForm form, PngPixels& pixels);
  const char* message() const { return errors_.message; }

 private:
  static void Take(png_structp png, png_bytep to, size_t size) {
    auto* reader = static_cast<PngReader*>(png_get_io_ptr(png));
    if (size > reader->rest_.size()) png_error(png, "cut short");
    std::copy_n(reader->rest_.data(), size, to);
    reader->rest_ = reader->rest_.subspan(size);
  }
  // Asks libpng for the form and sets the kind of `pixels`.
  void Ask(PngForm form, PngPixels& pixels);

  std::span<const uint8_t> rest_;  // what libpng has not read yet
  PngErrors errors_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::vector<png_bytep> rows_;
};

void PngReader::Ask(PngForm form, PngPixels& pixels) {
  const int colour = png_get_color_type(png_, info_);
  const bool is_grey = (colour & PNG_COLOR_MASK_COLOR) == 0;
  const bool has_key = !is_grey && png_get_valid(png_, info_, PNG_INFO_tRNS) != 0;
  const bool has_alpha = (colour & PNG_COLOR_MASK_ALPHA) != 0 || has_key;
  const bool is_photograph = form == PngForm::kPhotograph;
  pixels.channels = has_alpha ? 4 : is_grey && !is_photograph ? 1 : 3;
  pixels.bit_depth = png_get_bit_depth(png_, info_) == 16 && (has_alpha || !is_photograph) ? 16 : 8;
  if (pixels.bit_depth == 8) png_set_strip_16(png_);
  if (pixels.bit_depth == 16 && kLittleEndian) png_set_swap(png_);
  if (has_key) png_set_tRNS_to_alpha(png_);
  if (colour == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
  if (is_grey) png_set_expand_gray_1_2_4_to_8(png_);
  if (is_grey && pixels.channels > 1) png_set_gray_to_rgb(png_);
  png_set_interlace_handling(png_);
}

bool PngReader::Read(const ImageHeader& header, PngForm form, PngPixels& pixels) {
  png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &errors_, Fail, Ignore);
  if (png_ != nullptr) info_ = png_create_info_struct(png_);
  if (info_ == nullptr) return false;
  if (setjmp(png_jmpbuf(png_)) != 0) return false;
  png_set_read_fn(png_, this, Take);
  png_read_info(png_, info_);
  Ask(form, pixels);
  png_read_update_info(png_, info_);
  const size_t row_bytes =
      static_cast<size_t>(header.width) * pixels.channels * pixels.bit_depth / 8;
  if (png_get_rowbytes(png_, info_) != row_bytes ||
      png_get_image_height(png_, info_) != static_cast<png_uint_32>(header.height)) {
    png_error(png_, "another size than its header says");
  }
  pixels.bytes.resize(row_bytes * header.height);
  rows_.resize(static_cast<size_t>(header.height));
  for (size_t y = 0; y < rows_.size(); ++y) rows_[y] = pixels.bytes.data() + y * row_bytes;
  png_read_image(png_, rows_.data());
  png_read_end(png_, nullptr);
  return true;
}

class PngWriter {
 public:
  PngWriter() = default;
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  bool Write(int width, int height, int channels, int bit_depth, const uint8_t* samples);
  std::string& bytes() { return bytes_; }
  const char* message() const { return errors_.message; }

 private:
  bool Append(const uint8_t* from, size_t size) {
    try {
      bytes_.append(reinterpret_cast<const char*>(from), size);
      return true;
    } catch (const std::exception&) {  // no memory; it must not pass through libpng
      return false;
    }
  }
  static void Put(png_structp png, png_bytep from, size_t size) {
    if (!static_cast<PngWriter*>(png_get_io_ptr(png))->Append(from, size)) {
      png_error(png, "out of memory");
    }
  }

  PngErrors errors_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::string bytes_;
};

bool PngWriter::Write(int width, int height, int channels, int bit_depth, const uint8_t* samples) {
  png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, &errors_, Fail, Ignore);
  if (png_ != nullptr) info_ = png_create_info_struct(png_);
  if (info_ == nullptr) return false;
  if (setjmp(png_jmpbuf(png_)) != 0) return false;
  png_set_write_fn(png_, this, Put, nullptr);
  // Looks for runs of equal differences only, which is several times as fast as a full search.
  png_set_filter(png_, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png_, Z_BEST_SPEED);
  png_set_compression_strategy(png_, Z_RLE);
  const int colour = channels == 1   ? PNG_COLOR_TYPE_GRAY
                     : channels == 3 ? PNG_COLOR_TYPE_RGB
                                     : PNG_COLOR_TYPE_RGB_ALPHA;
  png_set_IHDR(png_, info_, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
               bit_depth, colour, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png_, info_);
  if (bit_depth == 16 && kLittleEndian) png_set_swap(png_);
  const size_t row_bytes = static_cast<size_t>(width) * channels * bit_depth / 8;
  for (int y = 0; y < height; ++y) {
    png_write_row(png_, samples + static_cast<size_t>(y) * row_bytes);
  }
  png_write_end(png_, nullptr);
  return true;
}

}  // namespace

absl::StatusOr<PngPixels> DecodePng(std::span<const uint8_t> bytes, const ImageHeader& header,
                                    absl::string_view name, PngForm form) {
  PngPixels pixels;
  PngReader reader(bytes);
  if (reader.Read(header, form, pixels)) return pixels;
  return Refused(name, absl::StrCat("does not decode: ", reader.message()));
}

absl::StatusOr<std::string> PngBytes(int width, int height, int channels, int bit_depth,
                                     const uint8_t* samples) {
  PngWriter writer;
  if (writer.Write(width, height, channels, bit_depth, samples)) return std::move(writer.bytes());
  return absl::InternalError(absl::StrCat("cannot encode an image: ", writer.message()));
}

}  // namespace pepeseg
