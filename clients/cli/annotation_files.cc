#include "clients/cli/annotation_files.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/mask_polygons.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Returns the text of a document. Bytes that are not UTF-8 are replaced.
std::string TextOf(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

// Returns the categories in the order in which the things have them.
std::vector<std::string> CategoriesOf(const LabelledMasks& masks) {
  std::vector<std::string> categories;
  for (const LabelledThing& thing : masks.things) {
    if (std::find(categories.begin(), categories.end(), thing.category) == categories.end()) {
      categories.push_back(thing.category);
    }
  }
  return categories;
}

int64_t IndexOf(const std::vector<std::string>& categories, const LabelledThing& thing) {
  return std::find(categories.begin(), categories.end(), thing.category) - categories.begin();
}

// Returns a thing for the lists of things next to the masks.
Json ThingJson(const LabelledThing& thing) {
  return {{"label", thing.id},
          {"text", thing.text},
          {"category", thing.category},
          {"instance_id", thing.instance},
          {"track_id", thing.track}};
}

// Returns the path of a file for each view: its name with `suffix` for its own, folders included.
// Views that differ in their suffix only keep it. A name that leads out of a folder is flattened.
std::vector<fs::path> FilesOf(const LabelledMasks& masks, const std::string& suffix) {
  std::map<std::string, int> count;
  const auto stem = [](const std::string& view) {
    const fs::path path = fs::path(view).lexically_normal();
    const bool leads_out = path.is_absolute() || (!path.empty() && *path.begin() == "..");
    return leads_out ? Stem(view) : fs::path(path).replace_extension().generic_string();
  };
  for (const LabelledView& view : masks.views) ++count[stem(view.view)];
  std::vector<fs::path> files;
  for (const LabelledView& view : masks.views) {
    const std::string name = stem(view.view);
    const std::string kept = count[name] > 1 ? fs::path(view.view).extension().string() : "";
    files.emplace_back(name + kept + suffix);
  }
  return files;
}

absl::Status WriteYolo(const LabelledMasks& masks, const fs::path& folder) {
  const std::vector<fs::path> files = FilesOf(masks, ".txt");
  std::string tracks = "file,line,track_id\n";
  for (size_t v = 0; v < masks.views.size(); ++v) {
    const fs::path file = fs::path("labels") / files[v];
    ASSIGN_OR_RETURN(const YoloText text, YoloOf(masks, masks.views[v], file.generic_string()));
    RETURN_IF_ERROR(WriteFile(folder / file, text.lines));
    tracks += text.tracks;
  }
  Json things = Json::array();
  for (const LabelledThing& thing : masks.things) things.push_back(ThingJson(thing));
  RETURN_IF_ERROR(WriteFile(folder / "tracks.csv", tracks));
  RETURN_IF_ERROR(WriteFile(folder / "things.json", TextOf(things)));
  std::string data =
      "# The photographs belong into images, next to labels.\ntrain: images\nval: images\nnames:\n";
  const std::vector<std::string> categories = CategoriesOf(masks);
  for (size_t i = 0; i < categories.size(); ++i) {
    // A text in JSON is a text in YAML.
    absl::StrAppend(&data, "  ", i, ": ",
                    Json(categories[i]).dump(-1, ' ', false, Json::error_handler_t::replace), "\n");
  }
  return WriteFile(folder / "data.yaml", data);
}

absl::Status WriteLabelMe(const LabelledMasks& masks, const fs::path& folder) {
  const std::vector<fs::path> files = FilesOf(masks, ".json");
  for (size_t v = 0; v < masks.views.size(); ++v) {
    ASSIGN_OR_RETURN(const std::string json, LabelMeJson(masks, masks.views[v]));
    RETURN_IF_ERROR(WriteFile(folder / files[v], json));
  }
  return absl::OkStatus();
}

// Writes ID/STEM.png for each label and view, and things.json.
absl::Status WriteMasks(const LabelledMasks& masks, const fs::path& folder) {
  const std::vector<fs::path> files = FilesOf(masks, ".png");
  Json things = Json::array();
  for (size_t t = 0; t < masks.things.size(); ++t) {
    things.push_back(ThingJson(masks.things[t]));
    for (size_t v = 0; v < masks.views.size(); ++v) {
      RETURN_IF_ERROR(WriteMask(folder / masks.things[t].id / files[v], masks.views[v].masks[t]));
    }
  }
  return WriteFile(folder / "things.json", TextOf(things));
}

}  // namespace

std::string CocoJson(const LabelledMasks& masks) {
  const std::vector<std::string> categories = CategoriesOf(masks);
  Json json;
  json["info"] = {{"description", absl::StrCat("pepeseg: ", masks.scene)}};
  json["images"] = json["categories"] = json["annotations"] = Json::array();
  for (size_t i = 0; i < categories.size(); ++i) {
    json["categories"].push_back({{"id", i + 1}, {"name", categories[i]}, {"supercategory", ""}});
  }
  for (size_t v = 0; v < masks.views.size(); ++v) {
    const LabelledView& view = masks.views[v];
    json["images"].push_back({{"id", v + 1},
                              {"file_name", view.view},
                              {"width", view.size.width},
                              {"height", view.size.height}});
    for (size_t t = 0; t < masks.things.size(); ++t) {
      const LabelledThing& thing = masks.things[t];
      const v1::CocoRle& rle = view.masks[t];
      const auto mask = DecodeRle(rle);
      const MaskExtent extent =
          mask.ok() ? ExtentOf(*mask, {rle.width(), rle.height()}) : MaskExtent();
      if (extent.area == 0) continue;
      json["annotations"].push_back(
          {{"id", json["annotations"].size() + 1},
           {"image_id", v + 1},
           {"category_id", IndexOf(categories, thing) + 1},
           {"segmentation", {{"size", {rle.height(), rle.width()}}, {"counts", rle.counts()}}},
           {"area", extent.area},
           {"bbox", {extent.x, extent.y, extent.width, extent.height}},
           {"iscrowd", 0},
           {"instance_id", thing.instance},
           {"track_id", thing.track},
           {"label", thing.id}});
    }
  }
  return TextOf(json);
}

absl::StatusOr<YoloText> YoloOf(const LabelledMasks& masks, const LabelledView& view,
                                const std::string& file) {
  const std::vector<std::string> categories = CategoriesOf(masks);
  YoloText text;
  int line = 0;
  for (size_t t = 0; t < masks.things.size(); ++t) {
    const v1::CocoRle& rle = view.masks[t];
    ASSIGN_OR_RETURN(const Mask mask, DecodeRle(rle));
    const Polygon polygon = Joined(PolygonsOf(mask, {rle.width(), rle.height()}));
    if (polygon.empty()) continue;
    absl::StrAppend(&text.lines, IndexOf(categories, masks.things[t]));
    for (const OutlinePoint& point : polygon) {
      absl::StrAppendFormat(&text.lines, " %.7f %.7f", point.x / rle.width(),
                            point.y / rle.height());
    }
    text.lines += "\n";
    absl::StrAppend(&text.tracks, file, ",", ++line, ",", masks.things[t].track, "\n");
  }
  return text;
}

absl::StatusOr<std::string> LabelMeJson(const LabelledMasks& masks, const LabelledView& view) {
  Json shapes = Json::array();
  for (size_t t = 0; t < masks.things.size(); ++t) {
    const v1::CocoRle& rle = view.masks[t];
    ASSIGN_OR_RETURN(const Mask mask, DecodeRle(rle));
    for (const Polygon& polygon : PolygonsOf(mask, {rle.width(), rle.height()})) {
      Json points = Json::array();
      for (const OutlinePoint& point : polygon) points.push_back({point.x, point.y});
      const LabelledThing& thing = masks.things[t];
      shapes.push_back({{"label", thing.category},
                        {"points", std::move(points)},
                        {"group_id", thing.track},
                        {"description", absl::StrCat(thing.category, ".", thing.instance)},
                        {"shape_type", "polygon"},
                        {"flags", Json::object()},
                        {"mask", nullptr}});
    }
  }
  const Json json = {
      {"version", "5.5.0"},           {"flags", Json::object()},
      {"shapes", std::move(shapes)},  {"imagePath", fs::path(view.view).filename().string()},
      {"imageData", nullptr},         {"imageHeight", view.size.height},
      {"imageWidth", view.size.width}};
  return TextOf(json);
}

absl::Status WriteAnnotations(const LabelledMasks& masks, const std::string& format,
                              const fs::path& path) {
  if (format == "coco") return WriteFile(path, CocoJson(masks));
  if (format == "yolo") return WriteYolo(masks, path);
  if (format == "labelme") return WriteLabelMe(masks, path);
  return WriteMasks(masks, path);
}

}  // namespace pepeseg::client::cli
