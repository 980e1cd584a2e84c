#include "core/dataset/mask_files.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/sam_masks.h"
#include "core/formats/images.h"
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

absl::StatusOr<MaskSet> ReadSamMasks(const std::filesystem::path& path, const std::string& name,
                                     const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, name, kMaxMaskFileBytes));
  return ParseSamMasks(text, name, photo);
}

// Reads a label image at the photograph's size. If it is one mask with soft borders, its labels
// become 0 and 1. Sets notes->soft, unless `notes` is null.
absl::StatusOr<LabelImage> ReadLabels(const std::filesystem::path& path, const std::string& name,
                                      const PhotoSize& photo, LabelNotes* notes = nullptr) {
  ASSIGN_OR_RETURN(LabelImage image, DecodeLabels(path, name));
  RETURN_IF_ERROR(CheckMaskShape(name, image.width, image.height, photo));
  const std::optional<uint32_t> threshold = SoftMaskThreshold(image);
  if (notes != nullptr) notes->soft = threshold.has_value();
  if (threshold) {
    for (uint32_t& label : image.labels) label = label > *threshold ? 1 : 0;
  }
  if (image.width == photo.width && image.height == photo.height) return image;
  return ResizedLabels(image, photo.width, photo.height);
}

// Reads a label image. Its masks do not overlap; one mask is made for each value except 0 and that
// of void pixels, in the order of the values.
absl::StatusOr<MaskSet> ReadLabelMasks(const std::filesystem::path& path, const std::string& name,
                                       const PhotoSize& photo, LabelNotes* notes) {
  ASSIGN_OR_RETURN(LabelImage image, ReadLabels(path, name, photo, notes));
  if (HasVoidBorders(image)) {
    std::ranges::replace(image.labels, image.void_label, uint32_t{0});
    if (notes != nullptr) notes->has_void = true;
  }
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
  RETURN_IF_ERROR(CheckMaskShape(name, stack.width, stack.height, photo));
  RETURN_IF_ERROR(CheckCount(name, static_cast<size_t>(stack.num_images)));
  MaskSetBuilder builder(photo.width, photo.height);
  const size_t num_pixels = static_cast<size_t>(stack.width) * stack.height;
  std::vector<uint32_t> pixels;
  for (int mask = 0; mask < stack.num_images; ++mask) {
    pixels.clear();
    const absl::string_view values = stack.values.substr(mask * num_pixels, num_pixels);
    for (size_t i = 0; i < num_pixels; ++i) {
      if (values[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
    }
    RETURN_IF_ERROR(AddMask(absl::StrCat(name, ": mask ", mask),
                            ScaledPixels(std::move(pixels), stack.width, stack.height, photo),
                            builder));
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
    ASSIGN_OR_RETURN(const LabelImage image, ReadLabels(file->path, file->name, photo));
    pixels.clear();
    for (size_t i = 0; i < image.labels.size(); ++i) {
      if (image.labels[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
    }
    RETURN_IF_ERROR(AddMask(file->name, pixels, builder));
  }
  return std::move(builder).Build();
}

std::vector<uint32_t> ScaledPixels(std::vector<uint32_t> pixels, int width, int height,
                                   const PhotoSize& photo) {
  if (width == photo.width && height == photo.height) return pixels;
  LabelImage image{width, height, std::vector<uint32_t>(static_cast<size_t>(width) * height, 0)};
  for (const uint32_t pixel : pixels) image.labels[pixel] = 1;
  const LabelImage scaled = ResizedLabels(image, photo.width, photo.height);
  pixels.clear();
  for (size_t i = 0; i < scaled.labels.size(); ++i) {
    if (scaled.labels[i] != 0) pixels.push_back(static_cast<uint32_t>(i));
  }
  return pixels;
}

absl::Status CheckMaskShape(absl::string_view where, int64_t width, int64_t height,
                            const PhotoSize& photo) {
  constexpr double kMostError = 0.03;  // of the side, where a pixel is more
  const auto differs = [](int64_t side, double expected) {
    return std::abs(static_cast<double>(side) - expected) > std::min(1.0, kMostError * expected);
  };
  const double expected_height = static_cast<double>(width) * photo.height / photo.width;
  const double expected_width = static_cast<double>(height) * photo.width / photo.height;
  if (!differs(height, expected_height) || !differs(width, expected_width)) {
    return absl::OkStatus();
  }
  return Refused(where,
                 absl::StrCat("has ", width, "x", height, " pixels, its photograph ", photo.name,
                              " has ", photo.width, "x", photo.height, ": not of one shape"));
}

absl::StatusOr<MaskSet> ReadMasks(const std::filesystem::path& path, const std::string& name,
                                  const PhotoSize& photo, LabelNotes* notes) {
  if (notes != nullptr) *notes = {};
  const std::string suffix = Suffix(name);
  if (suffix == ".json") return ReadSamMasks(path, name, photo);
  if (suffix == ".png") return ReadLabelMasks(path, name, photo, notes);
  if (suffix == ".npy") return ReadNpyMasks(path, name, photo);
  return Refused(name, "masks come as .json, .png or .npy");
}

absl::StatusOr<std::vector<uint8_t>> ReadIgnoreMask(const std::filesystem::path& path,
                                                    const std::string& name,
                                                    const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const LabelImage image, ReadLabels(path, name, photo));
  std::vector<uint8_t> ignore;
  ignore.reserve(image.labels.size());
  for (const uint32_t label : image.labels) ignore.push_back(label != 0 ? 1 : 0);
  return ignore;
}

}  // namespace pepeseg
