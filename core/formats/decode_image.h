#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/scene/capture.h"

namespace pepeseg {

inline constexpr int64_t kMaxImageFileBytes = int64_t{512} << 20;

// A label per pixel, row-major [height, width]; 0: none. A colour image's labels are its colours.
struct LabelImage {
  int width = 0;
  int height = 0;
  std::vector<uint32_t> labels;
};

// RGB, 8 bit. The EXIF orientation is left out of account: poses belong to the pixels as stored.
// `transparent`, where wanted: [height, width], 1 where alpha is under a half; empty when the file
// has no alpha of 8 bits. INVALID_ARGUMENT with `name`: what ReadImageHeader refuses, and what does
// not decode.
absl::StatusOr<Image> DecodePhoto(const std::filesystem::path& path, absl::string_view name,
                                  std::vector<uint8_t>* transparent = nullptr);
absl::StatusOr<Image> DecodePhoto(std::span<const uint8_t> bytes, absl::string_view name,
                                  std::vector<uint8_t>* transparent = nullptr);

// A PNG of 1 to 16 bits a channel, grey or colour; errors as above, and another format.
absl::StatusOr<LabelImage> DecodeLabels(const std::filesystem::path& path, absl::string_view name);

// A grey PNG of 1 to 16 bits, in a file or in memory; errors as above, and colours.
absl::StatusOr<FloatImage> DecodeGrey(const std::filesystem::path& path, absl::string_view name);
absl::StatusOr<FloatImage> DecodeGrey(std::span<const uint8_t> bytes, absl::string_view name);

}  // namespace pepeseg
