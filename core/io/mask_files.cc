#include "core/io/mask_files.h"

#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/io/decode_image.h"
#include "core/io/file_bytes.h"
#include "core/io/file_name.h"
#include "core/io/refused.h"
#include "core/io/rle.h"
#include "core/status_macros.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

constexpr int64_t kMaxJsonBytes = int64_t{64} << 20;
constexpr int64_t kMaxBitsetBytes = int64_t{1} << 30;

absl::Status CheckSize(absl::string_view where, int64_t width, int64_t height,
                       const PhotoSize& photo) {
  if (width == photo.width && height == photo.height) return absl::OkStatus();
  return Refused(where, absl::StrCat("has ", width, "x", height, " pixels, its photograph ",
                                     photo.name, " has ", photo.width, "x", photo.height));
}

absl::Status CheckCount(absl::string_view name, size_t count) {
  if (count <= kMaxMasksOfView) return absl::OkStatus();
  return Refused(name, absl::StrCat("has ", count, " masks, the limit is ", kMaxMasksOfView));
}

absl::StatusOr<std::vector<int64_t>> ParseCounts(const json& counts) {
  if (counts.is_string()) return ParseCocoCounts(counts.get_ref<const std::string&>());
  if (!counts.is_array()) return absl::InvalidArgumentError("\"counts\" is no list and no string");
  std::vector<int64_t> runs;
  runs.reserve(counts.size());
  for (const json& run : counts) {
    if (!run.is_number_integer()) {
      return absl::InvalidArgumentError(absl::StrCat("run ", runs.size(), " is no whole number"));
    }
    runs.push_back(run.get<int64_t>());
  }
  return runs;
}

// The pixels of one element of SAM's list.
absl::StatusOr<std::vector<uint32_t>> ParseSamMask(const json& value, const std::string& where,
                                                   const PhotoSize& photo) {
  const json nothing;
  const auto member = [&nothing](const json& object, const char* key) -> const json& {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return object.is_object() && found != object.end() ? *found : nothing;
  };
  const json& segmentation = member(value, "segmentation");
  const json& size = member(segmentation, "size");
  if (!size.is_array() || size.size() != 2 || !size[0].is_number_integer() ||
      !size[1].is_number_integer()) {
    return Refused(where, "has no \"segmentation\" with a \"size\": [height, width]");
  }
  RETURN_IF_ERROR(CheckSize(where, size[1].get<int64_t>(), size[0].get<int64_t>(), photo));
  absl::StatusOr<std::vector<int64_t>> runs = ParseCounts(member(segmentation, "counts"));
  if (!runs.ok()) return Refused(where, runs.status().message());
  absl::StatusOr<std::vector<uint32_t>> pixels = PixelsOfRuns(*runs, photo.width, photo.height);
  if (!pixels.ok()) return Refused(where, pixels.status().message());
  return pixels;
}

absl::StatusOr<MaskSet> ReadSamMasks(const std::filesystem::path& path, const std::string& name,
                                     const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, name, kMaxJsonBytes));
  const json document = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (document.is_discarded()) return Refused(name, "is not JSON, or cut short");
  if (!document.is_array()) return Refused(name, "is not a list of masks");
  RETURN_IF_ERROR(CheckCount(name, document.size()));
  MaskSetBuilder builder(photo.width, photo.height);
  for (size_t i = 0; i < document.size(); ++i) {
    const std::string where = absl::StrCat(name, ": mask ", i);
    ASSIGN_OR_RETURN(const std::vector<uint32_t> pixels, ParseSamMask(document[i], where, photo));
    builder.Add(pixels);
    if (builder.BitsetBytes() > kMaxBitsetBytes) {
      return Refused(where, "the masks overlap in too many ways to be those of objects");
    }
  }
  return std::move(builder).Build();
}

absl::StatusOr<MaskSet> ReadLabelMasks(const std::filesystem::path& path, const std::string& name,
                                       const PhotoSize& photo) {
  ASSIGN_OR_RETURN(const LabelImage image, DecodeLabels(path, name));
  RETURN_IF_ERROR(CheckSize(name, image.width, image.height, photo));
  std::map<uint32_t, std::vector<uint32_t>> pixels_of_label;
  for (size_t i = 0; i < image.labels.size(); ++i) {
    if (image.labels[i] == 0) continue;
    pixels_of_label[image.labels[i]].push_back(static_cast<uint32_t>(i));
    RETURN_IF_ERROR(CheckCount(name, pixels_of_label.size()));
  }
  MaskSetBuilder builder(photo.width, photo.height);
  for (const auto& [label, pixels] : pixels_of_label) builder.Add(pixels);
  return std::move(builder).Build();
}

}  // namespace

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
  RETURN_IF_ERROR(CheckSize(name, image.width, image.height, photo));
  std::vector<uint8_t> ignore;
  ignore.reserve(image.labels.size());
  for (const uint32_t label : image.labels) ignore.push_back(label != 0 ? 1 : 0);
  return ignore;
}

}  // namespace pepeseg
