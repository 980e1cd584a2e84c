#include "clients/cli/picture.h"

#include <stb_image.h>
#include <stb_image_write.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

constexpr int kMaxSide = 16384;  // pixels; a larger one is no photograph of ours

using StbPixels = std::unique_ptr<stbi_uc, void (*)(void*)>;

const stbi_uc* Data(absl::string_view bytes) {
  return reinterpret_cast<const stbi_uc*>(bytes.data());
}
int Size(absl::string_view bytes) {
  return static_cast<int>(std::min<size_t>(bytes.size(), INT32_MAX));
}

struct Decoded {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> pixels;
};

// From the head: the size, and how many channels there are.
absl::StatusOr<int> CheckHead(absl::string_view bytes, absl::string_view name, Decoded& image) {
  int in_file = 0;
  if (stbi_info_from_memory(Data(bytes), Size(bytes), &image.width, &image.height, &in_file) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": neither JPEG nor PNG"));
  }
  if (image.width > kMaxSide || image.height > kMaxSide) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", image.width, "x", image.height,
                                                   " pixels, over ", kMaxSide, " a side"));
  }
  return in_file;
}

// `channels` is 1 or 3, whatever the file has.
absl::StatusOr<Decoded> Decode(absl::string_view bytes, absl::string_view name, int channels) {
  Decoded image;
  ASSIGN_OR_RETURN(int in_file, CheckHead(bytes, name, image));
  const StbPixels pixels(stbi_load_from_memory(Data(bytes), Size(bytes), &image.width,
                                               &image.height, &in_file, channels),
                         stbi_image_free);
  if (pixels == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", stbi_failure_reason()));
  }
  const size_t count = static_cast<size_t>(image.width) * image.height * channels;
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

std::string PngBytes(int width, int height, int channels, const uint8_t* pixels) {
  std::string png;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), size);
  };
  stbi_write_png_to_func(append, &png, width, height, channels, pixels, width * channels);
  return png;
}

absl::Status WritePngBytes(const std::filesystem::path& path, int width, int height,
                           std::span<const uint8_t> pixels) {
  const int channels = static_cast<int>(pixels.size() / (static_cast<size_t>(width) * height));
  return WriteFile(path, PngBytes(width, height, channels, pixels.data()));
}

// Where a resized pixel comes from.
int SourceAt(int at, int size, int source_size) {
  return std::min(source_size - 1, static_cast<int>((at + 0.5) * source_size / size));
}

}  // namespace

Picture Picture::Filled(int width, int height, Rgb color) {
  Picture picture{width, height, std::vector<uint8_t>(static_cast<size_t>(width) * height * 3)};
  for (size_t i = 0; i < picture.pixels.size(); i += 3) {
    picture.pixels[i] = color.r;
    picture.pixels[i + 1] = color.g;
    picture.pixels[i + 2] = color.b;
  }
  return picture;
}

absl::StatusOr<Picture> DecodePicture(absl::string_view bytes, absl::string_view name) {
  ASSIGN_OR_RETURN(Decoded image, Decode(bytes, name, 3));
  return Picture{image.width, image.height, std::move(image.pixels)};
}

absl::StatusOr<Grey16Picture> DecodeGrey16(absl::string_view bytes, absl::string_view name) {
  Decoded head;
  ASSIGN_OR_RETURN(int channels, CheckHead(bytes, name, head));
  if (channels != 1 || stbi_is_16_bit_from_memory(Data(bytes), Size(bytes)) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": not grey of 16 bits"));
  }
  const std::unique_ptr<stbi_us, void (*)(void*)> pixels(
      stbi_load_16_from_memory(Data(bytes), Size(bytes), &head.width, &head.height, &channels, 1),
      stbi_image_free);
  if (pixels == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", stbi_failure_reason()));
  }
  const size_t count = static_cast<size_t>(head.width) * head.height;
  return Grey16Picture{head.width, head.height, {pixels.get(), pixels.get() + count}};
}

absl::StatusOr<Picture> ReadPicture(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  return DecodePicture(bytes, path.string());
}

absl::StatusOr<GreyPicture> ReadGreyPicture(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  ASSIGN_OR_RETURN(Decoded image, Decode(bytes, path.string(), 1));
  return GreyPicture{image.width, image.height, std::move(image.pixels)};
}

absl::Status WritePng(const std::filesystem::path& path, const Picture& picture) {
  return WritePngBytes(path, picture.width, picture.height, picture.pixels);
}

absl::Status WritePng(const std::filesystem::path& path, const GreyPicture& picture) {
  return WritePngBytes(path, picture.width, picture.height, picture.pixels);
}

std::string EncodePng(const GreyPicture& picture) {
  return PngBytes(picture.width, picture.height, 1, picture.pixels.data());
}

GreyPicture Resized(const GreyPicture& picture, int width, int height) {
  GreyPicture result{width, height, {}};
  result.pixels.reserve(static_cast<size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    const size_t row = static_cast<size_t>(SourceAt(y, height, picture.height)) * picture.width;
    for (int x = 0; x < width; ++x) {
      result.pixels.push_back(picture.pixels[row + SourceAt(x, width, picture.width)]);
    }
  }
  return result;
}

Picture Resized(const Picture& picture, int width, int height) {
  Picture result = Picture::Filled(width, height, {});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const uint8_t* from =
          picture.At(SourceAt(x, width, picture.width), SourceAt(y, height, picture.height));
      std::copy(from, from + 3, result.At(x, y));
    }
  }
  return result;
}

}  // namespace pepeseg::client::cli
