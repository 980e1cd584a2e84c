#include "clients/benchmark/scene_truth.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/benchmark/outline_files.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

// Returns true if a folder or one of its subfolders has a PNG.
bool HasPng(const fs::path& folder) {
  std::error_code error;
  auto entry = fs::recursive_directory_iterator(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (entry->path().extension() == ".png") return true;
  }
  return false;
}

// Returns true if a path leads to a folder images/, however it is written.
bool IsImagesFolder(const fs::path& path) {
  std::error_code error;
  const fs::path whole = fs::absolute(path, error).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename() == "images";
}

// Returns the outlines in a file or a folder.
absl::StatusOr<std::vector<OutlinedPhotograph>> OutlinesIn(const fs::path& path) {
  // Cameras and catalogues write JSON of their own next to photographs.
  return ReadOutlines(path, !IsImagesFolder(path));
}

// Returns the level "labels" of a dataset without gt/labels.json; none if nothing is there.
absl::StatusOr<std::vector<TruthLevel>> FindLabels(const fs::path& dataset) {
  const fs::path labels = dataset / "labels";
  std::vector<TruthLevel> levels = {{"labels", labels, {}}};
  if (HasPng(labels)) return levels;
  for (const char* name : {"labels", "annotations.json", "annotations", "images"}) {
    const fs::path path = dataset / name;
    if (!PathExists(path)) continue;
    ASSIGN_OR_RETURN(levels[0].outlines, OutlinesIn(path));
    levels[0].folder = path;
    if (!levels[0].outlines.empty()) return levels;
  }
  levels[0].folder = labels;
  if (!PathExists(labels)) levels.clear();
  return levels;
}

// Reads a label image of 8 bits, or one of 16 bits whose ids fit into 8. INVALID_ARGUMENT: they do
// not.
absl::StatusOr<GreyPicture> ReadLabels(const fs::path& path) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const auto wide = DecodeGrey16(bytes, path.string());
  if (!wide.ok()) return ReadGreyPicture(path);
  GreyPicture labels{wide->width, wide->height, {}};
  labels.pixels.reserve(wide->pixels.size());
  for (const uint16_t id : wide->pixels) {
    if (id > 255) {
      return absl::InvalidArgumentError(
          absl::StrCat(path.string(), ": the id ", id,
                       " exceeds 255, the limit of `pepeseg-benchmark curves`; use "
                       "`pepeseg-benchmark evaluate`"));
    }
    labels.pixels.push_back(static_cast<uint8_t>(id));
  }
  return labels;
}

}  // namespace

bool PathExists(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

absl::StatusOr<std::vector<TruthLevel>> FindTruth(const fs::path& dataset) {
  const fs::path list = dataset / "gt" / "labels.json";
  if (!PathExists(list)) return FindLabels(dataset);
  std::vector<TruthLevel> levels;
  ASSIGN_OR_RETURN(const std::string text, ReadFile(list));
  const auto json = nlohmann::ordered_json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) {
    return absl::InvalidArgumentError(
        absl::StrCat(list.string(), ": expected a JSON object of levels"));
  }
  for (const auto& [name, entities] : json.items()) {
    TruthLevel level{name, dataset / "gt" / name, {}};
    int id = 0;
    for (const auto& entity : entities) {
      if (entity.is_string()) level.entities[id] = entity.get<std::string>();
      ++id;
    }
    levels.push_back(std::move(level));
  }
  return levels;
}

absl::StatusOr<std::vector<TruthLevel>> FindTruthAt(const fs::path& path) {
  ASSIGN_OR_RETURN(std::vector<TruthLevel> levels, FindTruth(path));
  if (!levels.empty() || PathExists(path / "images")) return levels;
  TruthLevel& level = levels.emplace_back(TruthLevel{"labels", path, {}});
  if (HasPng(path)) return levels;
  ASSIGN_OR_RETURN(level.outlines, OutlinesIn(path));
  return levels;
}

absl::Status AddOutlines(const OutlinedPhotograph& outlines, const PixelSize& size,
                         v1::ViewTruth& truth) {
  ASSIGN_OR_RETURN(const PixelSize fitting, FittingSize(outlines.file, outlines.size, size));
  for (const OutlinedEntity& entity : outlines.entities) {
    const GreyPicture mask = MaskOfEntity(entity, outlines.size, fitting);
    v1::EntityMask& added = *truth.add_masks();
    added.set_entity(entity.name);
    *added.mutable_mask()->mutable_rle() = EncodeRle(mask.pixels, mask.width, mask.height);
  }
  return absl::OkStatus();
}

absl::StatusOr<PixelSize> FittingSize(const fs::path& path, const PixelSize& image,
                                      const PixelSize& photograph) {
  for (const PixelSize& size : {photograph, PixelSize{photograph.height, photograph.width}}) {
    const double step = static_cast<double>(image.width) / size.width;
    if (std::abs(image.height / step - size.height) <= 1) return size;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path.string(), ": ", image.width, "x", image.height,
                   " pixels, which is not the shape of the photograph, ", photograph.width, "x",
                   photograph.height));
}

absl::StatusOr<std::string> LabelsPng(const fs::path& path, const PixelSize& photograph) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const auto wide = DecodeGrey16(bytes, path.string());
  if (wide.ok() && PixelSize{wide->width, wide->height} == photograph) return bytes;
  ASSIGN_OR_RETURN(const GreyPicture labels, ReadLabels(path));
  ASSIGN_OR_RETURN(const PixelSize size,
                   FittingSize(path, {labels.width, labels.height}, photograph));
  return EncodePng(Resized(labels, size.width, size.height));
}

}  // namespace pepeseg::client::cli
