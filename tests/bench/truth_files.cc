#include "tests/bench/truth_files.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

// Resamples labels to the size of the view, nearest neighbour.
absl::StatusOr<std::vector<uint16_t>> ReadLabels(const fs::path& path, const Camera& camera) {
  ASSIGN_OR_RETURN(const FloatImage image, DecodeGrey(path, path.string()));
  const double step = static_cast<double>(image.width) / camera.width;
  if (std::abs(image.height / step - camera.height) > 1 || step < 1) {
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": ", image.width, "x",
                                                   image.height, " labels, its view has ",
                                                   camera.width, "x", camera.height, " pixels"));
  }
  std::vector<uint16_t> labels;
  labels.reserve(static_cast<size_t>(camera.width) * camera.height);
  for (int y = 0; y < camera.height; ++y) {
    const int from_y = std::min(image.height - 1, static_cast<int>((y + 0.5) * step));
    for (int x = 0; x < camera.width; ++x) {
      const int from_x = std::min(image.width - 1, static_cast<int>((x + 0.5) * step));
      labels.push_back(
          static_cast<uint16_t>(image.values[static_cast<size_t>(from_y) * image.width + from_x]));
    }
  }
  return labels;
}

absl::StatusOr<TruthLevel> ReadLevel(const fs::path& folder, const std::string& name,
                                     const Capture& capture) {
  TruthLevel level;
  level.name = name;
  for (const View& view : capture.views) {
    const fs::path path = folder / fs::path(view.name).replace_extension(".png");
    level.labels.emplace_back();
    if (!fs::exists(path)) continue;
    ASSIGN_OR_RETURN(level.labels.back(), ReadLabels(path, view.camera));
  }
  return level;
}

}  // namespace

absl::StatusOr<std::vector<TruthLevel>> ReadTruth(const fs::path& folder, const Capture& capture) {
  std::vector<TruthLevel> levels;
  const fs::path list = folder / "gt" / "labels.json";
  if (fs::exists(list)) {
    std::ifstream file(list);
    const auto names = nlohmann::ordered_json::parse(file, nullptr, /*allow_exceptions=*/false);
    if (!names.is_object()) {
      return absl::InvalidArgumentError(absl::StrCat(list.string(), ": not an object of levels"));
    }
    for (const auto& [name, entities] : names.items()) {
      ASSIGN_OR_RETURN(TruthLevel level, ReadLevel(folder / "gt" / name, name, capture));
      for (const auto& entity : entities) {
        level.entities.push_back(entity.is_string() ? entity.get<std::string>() : "");
      }
      levels.push_back(std::move(level));
    }
  } else if (fs::exists(folder / "labels")) {
    ASSIGN_OR_RETURN(TruthLevel level, ReadLevel(folder / "labels", "labels", capture));
    levels.push_back(std::move(level));
  }
  return levels;
}

}  // namespace pepeseg
