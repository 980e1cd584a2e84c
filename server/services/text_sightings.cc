#include "server/services/text_sightings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/formats/file_json.h"
#include "core/formats/rle.h"

namespace pepeseg {
namespace {

using Json = nlohmann::json;

absl::Status NotFormat(absl::string_view what) { return absl::InvalidArgumentError(what); }

absl::Status ReadBox(const Json& box, const SearchedPhotograph& photo, Sighting& thing) {
  std::array<double, 4> sides{};
  if (!box.is_array() || box.size() != sides.size()) {
    return NotFormat("\"box\" is not a list [x0, y0, x1, y1]");
  }
  for (size_t i = 0; i < sides.size(); ++i) {
    if (!box[i].is_number()) return NotFormat("\"box\" has a side that is not a number");
    sides[i] = std::clamp(box[i].get<double>() / (i % 2 == 0 ? photo.width : photo.height), 0., 1.);
    if (!std::isfinite(sides[i])) return NotFormat("\"box\" has a side that is not finite");
  }
  thing.x0 = static_cast<float>(sides[0]);
  thing.y0 = static_cast<float>(sides[1]);
  thing.x1 = static_cast<float>(sides[2]);
  thing.y1 = static_cast<float>(sides[3]);
  return absl::OkStatus();
}

// Returns the runs of a mask. most: pixels of the photograph, and so runs of a mask.
absl::StatusOr<std::vector<int64_t>> ReadCounts(const Json& counts, int64_t most) {
  if (counts.is_string()) return ParseCocoCounts(counts.get_ref<const std::string&>(), most + 1);
  if (!counts.is_array()) return NotFormat("\"counts\" is neither a list nor a string");
  std::vector<int64_t> runs;
  for (const Json& run : counts) {
    if (!run.is_number_integer()) return NotFormat("\"counts\" has a run that is not an integer");
    runs.push_back(run.get<int64_t>());
  }
  return runs;
}

absl::Status ReadMask(const Json& segmentation, const SearchedPhotograph& photo, Sighting& thing) {
  const Json size = segmentation.value("size", Json());
  if (size != Json{photo.height, photo.width}) {
    return NotFormat(absl::StrCat("the mask's \"size\" is not the photograph's, [", photo.height,
                                  ", ", photo.width, "]"));
  }
  const int64_t num_pixels = int64_t{photo.width} * photo.height;
  ASSIGN_OR_RETURN(const std::vector<int64_t> runs,
                   ReadCounts(segmentation.value("counts", Json()), num_pixels));
  ASSIGN_OR_RETURN(const std::vector<uint32_t> pixels,
                   PixelsOfRuns(runs, photo.width, photo.height));
  if (pixels.empty()) return absl::OkStatus();
  std::vector<uint8_t> covered(static_cast<size_t>(num_pixels));
  for (const uint32_t pixel : pixels) covered[pixel] = 1;
  thing.mask_width = photo.grid_width;
  thing.mask_height = photo.grid_height;
  for (int y = 0; y < photo.grid_height; ++y) {
    const int64_t from_y = int64_t{2 * y + 1} * photo.height / (2 * photo.grid_height);
    for (int x = 0; x < photo.grid_width; ++x) {
      const int64_t from_x = int64_t{2 * x + 1} * photo.width / (2 * photo.grid_width);
      thing.mask.pixels.push_back(covered[from_y * photo.width + from_x]);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Sighting> ReadThing(const Json& json, const SearchedPhotograph& photo) {
  Sighting thing;
  const Json score = json.is_object() ? json.value("score", Json()) : Json();
  if (!score.is_number()) return NotFormat("has no \"score\"");
  thing.score = score.get<float>();
  if (!(thing.score <= 1)) return NotFormat("its \"score\" is above 1");
  if (json.contains("segmentation") && json["segmentation"].is_object()) {
    RETURN_IF_ERROR(ReadMask(json["segmentation"], photo, thing));
  } else if (json.contains("box")) {
    RETURN_IF_ERROR(ReadBox(json["box"], photo, thing));
  } else {
    return NotFormat("has neither a \"box\" nor a \"segmentation\"");
  }
  return thing;
}

}  // namespace

absl::StatusOr<std::vector<Sighting>> ParseTextSightings(absl::string_view text,
                                                         const std::string& name,
                                                         const SearchedPhotograph& photo) {
  const absl::StatusOr<Json> json = ParseFileJson(text);
  if (!json.ok()) return Refused(name, json.status().message());
  if (!json->is_array()) return Refused(name, "is not a list");
  if (json->size() > kMostTextThings) {
    return Refused(name,
                   absl::StrCat("has ", json->size(), " things; the limit is ", kMostTextThings));
  }
  std::vector<Sighting> things;
  for (size_t i = 0; i < json->size(); ++i) {
    absl::StatusOr<Sighting> thing = ReadThing((*json)[i], photo);
    if (!thing.ok()) {
      return Refused(absl::StrCat(name, ": thing ", i + 1), thing.status().message());
    }
    const bool empty =
        thing->mask.pixels.empty() && !(thing->x1 > thing->x0 && thing->y1 > thing->y0);
    if (thing->score > 0 && !empty) things.push_back(*std::move(thing));
  }
  return things;
}

}  // namespace pepeseg
