#include "core/dataset/mask_files.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/sam_masks.h"
#include "core/formats/decode_image.h"
#include "core/formats/npy.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxMaskFileBytes = int64_t{64} << 20;
constexpr int64_t kMaxNpyBytes = int64_t{512} << 20;
constexpr int64_t kMaxBitsetBytes = int64_t{1} << 30;

// Checks the number of masks of one photograph.
absl::Status CheckCount(absl::string_view name, size_t count) {
  if (count <= kMaxMasksOfView) return absl::OkStatus();
  return Refused(name, absl::StrCat("has ", count, " masks, the limit is ", kMaxMasksOfView));
}

// Returns true for a mask of 0 and 255 with a soft border, as editors, filters and JPEG make it:
// values between are fewer than those near 255, and seldom lie side by side as those of a label do.
bool HasSoftBorder(const LabelImage& image) {
  constexpr uint32_t kNearlyWhite = 247, kWhite = 255;
  const auto width = static_cast<size_t>(image.width);
  size_t num_white = 0, num_between = 0, num_flat = 0;
  for (size_t i = 0; i < image.labels.size(); ++i) {
    const uint32_t value = image.labels[i];
    if (value > kWhite) return false;
    if (value >= kNearlyWhite) ++num_white;
    if (value == 0 || value >= kNearlyWhite) continue;
    ++num_between;
    const bool has_neighbours = (i + 1) % width != 0 && i + width < image.labels.size();
    if (has_neighbours && image.labels[i + 1] == value && image.labels[i + width] == value) {
      ++num_flat;
    }
  }
  return num_between > 0 && num_white > num_between && num_flat * 4 < num_between;
}

// Returns 1 for pixels of at least 128 and 0 for others.
void Binarize(LabelImage& image) {
  for (uint32_t& label : image.labels) label = label >= 128 ? 1 : 0;
}

// Resizes labels to the size of their photograph by the nearest pixel: masks are often made on
// photographs that were shrunk. INVALID_ARGUMENT: the shapes differ by more than a pixel.
absl::Status FitToPhoto(absl::string_view name, const PhotoSize& photo, LabelImage& image) {
  if (image.width == photo.width && image.height == photo.height) return absl::OkStatus();
  const int64_t difference =
      std::abs(int64_t{image.width} * photo.height - int64_t{image.height} * photo.width);
  // A rounded width or height is off by less than a pixel of the smaller of both images.
  const int64_t allowed = std::max(photo.width, photo.height);
  if (difference > allowed) return CheckMaskSize(name, image.width, image.height, photo);
  std::vector<uint32_t> labels;
  labels.reserve(static_cast<size_t>(photo.width) * photo.height);
  for (int64_t y = 0; y < photo.height; ++y) {
    const int64_t row = (2 * y + 1) * image.height / (2 * photo.height);
    for (int64_t x = 0; x < photo.width; ++x) {
      const int64_t column = (2 * x + 1) * image.width / (2 * photo.width);
      labels.push_back(image.labels[static_cast<size_t>(row * image.width + column)]);
    }
  }
  image = {photo.width, photo.height, std::move(labels)};
  return absl::OkStatus();
}

absl::StatusOr<MaskSet> ReadSamMasks(const std::filesystem::path& path, const std::string& name,
                                     const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, name, kMaxMaskFileBytes));
  return ParseSamMasks(text, name, photo);
}

// Reads a label image. Its masks do not overlap; one mask is made for each value except 0, in the
// order of the values.
absl::StatusOr<MaskSet> ReadLabelMasks(const std::filesystem::path& path, const std::string& name,
                                       const PhotoSize& photo, bool* soft) {
  ASSIGN_OR_RETURN(LabelImage image, DecodeLabels(path, name));
  // Before it is resized, which makes flat borders.
  if (HasSoftBorder(image)) {
    Binarize(image);
    if (soft != nullptr) *soft = true;
  }
  RETURN_IF_ERROR(FitToPhoto(name, photo, image));
  // A map: the masks are numbered in the order of the labels, which is the same in each run.
  std::map<uint32_t, std::vector<uint32_t>> pixels_of_label;
  for (size_t i = 0; i < image.labels.size(); ++i) {
    if (image.labels[i] == 0) continue;
    pixels_of_label[image.labels[i]].push_back(static_cast<uint32_t>(i));
    // Inside the loop: a photograph saved as a label image has a value for nearly each pixel.
    RETURN_IF_ERROR(CheckCount(name, pixels_of_label.size()));
  }
  MaskSetBuilder builder(photo.width, photo.height);
  for (const auto& [label, pixels] : pixels_of_label) builder.Add(pixels);
  return std::move(builder).Build();
}

// Reads an array of masks, which may overlap.
absl::StatusOr<MaskSet> ReadNpyMasks(const std::filesystem::path& path, const std::string& name,
                                     const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, name, kMaxNpyBytes));
  ASSIGN_OR_RETURN(const NpyStack stack, ParseNpyStack(name, bytes));
  RETURN_IF_ERROR(CheckMaskSize(name, stack.width, stack.height, photo));
  RETURN_IF_ERROR(CheckCount(name, static_cast<size_t>(stack.num_images)));
  MaskSetBuilder builder(photo.width, photo.height);
  const size_t num_pixels = static_cast<size_t>(photo.width) * photo.height;
  std::vector<uint32_t> pixels;
  for (int mask = 0; mask < stack.num_images; ++mask) {
    pixels.clear();
    const absl::string_view values = stack.values.substr(mask * num_pixels, num_pixels);
    for (size_t i = 0; i < num_pixels; ++i) {
      if (values[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
    }
    RETURN_IF_ERROR(AddMask(absl::StrCat(name, ": mask ", mask), pixels, builder));
  }
  return std::move(builder).Build();
}

}  // namespace

absl::Status AddMask(absl::string_view where, std::span<const uint32_t> pixels,
                     MaskSetBuilder& builder) {
  builder.Add(pixels);
  // Each new overlap makes a mask cell with a bitset of all masks.
  if (builder.BitsetBytes() <= kMaxBitsetBytes) return absl::OkStatus();
  return Refused(where, "the masks overlap in too many ways to be those of objects");
}

absl::StatusOr<MaskSet> ReadBinaryMasks(std::span<const DatasetFile* const> files,
                                        const PhotoSize& photo) {
  RETURN_IF_ERROR(CheckCount(files.front()->name, files.size()));
  MaskSetBuilder builder(photo.width, photo.height);
  std::vector<uint32_t> pixels;
  for (const DatasetFile* file : files) {
    ASSIGN_OR_RETURN(LabelImage image, DecodeLabels(file->path, file->name));
    if (HasSoftBorder(image)) Binarize(image);
    RETURN_IF_ERROR(FitToPhoto(file->name, photo, image));
    pixels.clear();
    for (size_t i = 0; i < image.labels.size(); ++i) {
      if (image.labels[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
    }
    RETURN_IF_ERROR(AddMask(file->name, pixels, builder));
  }
  return std::move(builder).Build();
}

absl::Status CheckMaskSize(absl::string_view where, int64_t width, int64_t height,
                           const PhotoSize& photo) {
  if (width == photo.width && height == photo.height) return absl::OkStatus();
  return Refused(where, absl::StrCat("has ", width, "x", height, " pixels, its photograph ",
                                     photo.name, " has ", photo.width, "x", photo.height));
}

absl::StatusOr<MaskSet> ReadMasks(const std::filesystem::path& path, const std::string& name,
                                  const PhotoSize& photo, bool* soft) {
  const std::string suffix = Suffix(name);
  if (suffix == ".json") return ReadSamMasks(path, name, photo);
  if (suffix == ".png") return ReadLabelMasks(path, name, photo, soft);
  if (suffix == ".npy") return ReadNpyMasks(path, name, photo);
  return Refused(name, "masks come as .json, .png or .npy");
}

absl::StatusOr<std::vector<uint8_t>> ReadIgnoreMask(const std::filesystem::path& path,
                                                    const std::string& name,
                                                    const PhotoSize& photo) {
  ASSIGN_OR_RETURN(LabelImage image, DecodeLabels(path, name));
  RETURN_IF_ERROR(FitToPhoto(name, photo, image));
  std::vector<uint8_t> ignore;
  ignore.reserve(image.labels.size());
  for (const uint32_t label : image.labels) ignore.push_back(label != 0 ? 1 : 0);
  return ignore;
}

}  // namespace pepeseg
