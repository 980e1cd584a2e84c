#include "core/dataset/mask_files.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"
#include "core/base/file_name.h"
#include "core/base/private_error.h"
#include "core/base/status_macros.h"
#include "core/dataset/sam_masks.h"
#include "core/formats/decode_image.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxMaskFileBytes = int64_t{64} << 20;

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

// Reads a label image. Its masks do not overlap; one mask is made for each value except 0, in the
// order of the values.
absl::StatusOr<MaskSet> ReadLabelMasks(const std::filesystem::path& path, const std::string& name,
                                       const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const LabelImage image, DecodeLabels(path, name));
  RETURN_IF_ERROR(CheckMaskSize(name, image.width, image.height, photo));
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

}  // namespace

absl::Status CheckMaskSize(absl::string_view where, int64_t width, int64_t height,
                           const PhotoSize& photo) {
  if (width == photo.width && height == photo.height) return absl::OkStatus();
  return Refused(where, absl::StrCat("has ", width, "x", height, " pixels, its photograph ",
                                     photo.name, " has ", photo.width, "x", photo.height));
}

absl::StatusOr<MaskSet> ReadMasks(const std::filesystem::path& path, const std::string& name,
                                  const PhotoSize& photo) {
  const std::string suffix = Suffix(name);
  if (suffix == ".json") return ReadSamMasks(path, name, photo);
  if (suffix == ".png") return ReadLabelMasks(path, name, photo);
  return Refused(name, "masks come as .json or .png");
}

absl::StatusOr<std::vector<uint8_t>> ReadIgnoreMask(const std::filesystem::path& path,
                                                    const std::string& name,
                                                    const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const LabelImage image, DecodeLabels(path, name));
  RETURN_IF_ERROR(CheckMaskSize(name, image.width, image.height, photo));
  std::vector<uint8_t> ignore;
  ignore.reserve(image.labels.size());
  for (const uint32_t label : image.labels) ignore.push_back(label != 0 ? 1 : 0);
  return ignore;
}

}  // namespace pepeseg
