#include "clients/cli/bench_truth.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "clients/cli/outline_files.h"
#include "clients/cli/view_picture.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

bool Exists(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
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
                       " exceeds 255, the limit of `pepeseg bench`; use `pepeseg evaluate`"));
    }
    labels.pixels.push_back(static_cast<uint8_t>(id));
  }
  return labels;
}

// Returns INVALID_ARGUMENT unless both sides of an image have the same scale, up to the rounding of
// one pixel.
absl::Status CheckShape(const fs::path& path, const PixelSize& image, const PixelSize& photograph) {
  const double step = static_cast<double>(image.width) / photograph.width;
  if (std::abs(image.height / step - photograph.height) <= 1) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(path.string(), ": ", image.width, "x", image.height,
                   " pixels, which is not the shape of the photograph, ", photograph.width, "x",
                   photograph.height));
}

// Returns a label image as a PNG of the photograph's size.
absl::StatusOr<std::string> LabelsPng(const fs::path& path, const PixelSize& photograph) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path));
  const auto wide = DecodeGrey16(bytes, path.string());
  if (wide.ok() && PixelSize{wide->width, wide->height} == photograph) return bytes;
  ASSIGN_OR_RETURN(const GreyPicture labels, ReadLabels(path));
  RETURN_IF_ERROR(CheckShape(path, {labels.width, labels.height}, photograph));
  return EncodePng(Resized(labels, photograph.width, photograph.height));
}

// Returns true if a folder or one of its subfolders has a PNG.
bool HasPng(const fs::path& folder) {
  std::error_code error;
  auto entry = fs::recursive_directory_iterator(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (entry->path().extension() == ".png") return true;
  }
  return false;
}

// Returns the level "labels" of a dataset without gt/labels.json; none if nothing is there.
absl::StatusOr<std::vector<TruthLevel>> FindLabels(const fs::path& dataset) {
  const fs::path labels = dataset / "labels";
  std::vector<TruthLevel> levels = {{"labels", labels, {}}};
  if (HasPng(labels)) return levels;
  for (const char* name : {"labels", "annotations.json", "annotations", "images"}) {
    const fs::path path = dataset / name;
    if (!Exists(path)) continue;
    // Cameras and catalogues write JSON of their own next to photographs.
    ASSIGN_OR_RETURN(levels[0].outlines, ReadOutlines(path, path.filename() != "images"));
    levels[0].folder = path;
    if (!levels[0].outlines.empty()) return levels;
  }
  levels[0].folder = labels;
  if (!Exists(labels)) levels.clear();
  return levels;
}

// Adds the masks of the entities that are outlined in a photograph.
absl::Status AddOutlines(const OutlinedPhotograph& outlines, const PixelSize& photograph,
                         v1::ViewTruth& truth) {
  RETURN_IF_ERROR(CheckShape(outlines.file, outlines.size, photograph));
  for (const OutlinedEntity& entity : outlines.entities) {
    const GreyPicture mask = MaskOfEntity(entity, outlines.size, photograph);
    v1::EntityMask& added = *truth.add_masks();
    added.set_entity(entity.name);
    *added.mutable_mask()->mutable_rle() = EncodeRle(mask.pixels, mask.width, mask.height);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<TruthLevel>> FindTruth(const fs::path& dataset) {
  const fs::path list = dataset / "gt" / "labels.json";
  if (!Exists(list)) return FindLabels(dataset);
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

absl::StatusOr<v1::EvaluateModelRequest> EvaluateRequestOf(const fs::path& dataset,
                                                           const TruthLevel& level,
                                                           const std::string& model,
                                                           const std::vector<v1::View>& views) {
  v1::EvaluateModelRequest request;
  request.set_model(model);
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  for (const auto& [id, name] : level.entities) (*request.mutable_entity_names())[id] = name;
  const fs::path ignore = dataset / "ignore_mask.png";
  for (const v1::View& view : views) {
    const fs::path path = level.folder / fs::path(view.view()).replace_extension(".png");
    const OutlinedPhotograph* outlines = OutlinesOf(level.outlines, view.view());
    if (!view.held_out() || (outlines == nullptr && !Exists(path))) continue;
    v1::ViewTruth& truth = *request.add_views();
    truth.set_view(view.view());
    if (outlines != nullptr) {
      RETURN_IF_ERROR(AddOutlines(*outlines, PhotographSize(view), truth));
    } else {
      ASSIGN_OR_RETURN(*truth.mutable_labels_png(), LabelsPng(path, PhotographSize(view)));
    }
    if (!Exists(ignore)) continue;
    ASSIGN_OR_RETURN(*truth.mutable_ignore_png(), LabelsPng(ignore, PhotographSize(view)));
  }
  return request;
}

}  // namespace pepeseg::client::cli
