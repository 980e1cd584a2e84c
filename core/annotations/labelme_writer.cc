#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/annotations/format_writers.h"
#include "core/annotations/mask_polygons.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using ShapeJson = nlohmann::ordered_json;

class LabelMeWriter final : public AnnotationWriter {
 public:
  LabelMeWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene), zip_(zip), files_(FilesOfViews(scene, ".json")) {}

  absl::Status Add(const AnnotatedView& view) override {
    ShapeJson shapes = ShapeJson::array();
    for (size_t t = 0; t < scene_.things.size(); ++t) {
      if (ShowNothing(view.counts[t], view.size)) continue;
      const AnnotatedThing& thing = scene_.things[t];
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      for (const Polygon& polygon : PolygonsOf(mask.pixels, view.size)) {
        ShapeJson points = ShapeJson::array();
        for (const PolygonPoint& point : polygon) points.push_back({point.x, point.y});
        shapes.push_back({{"label", thing.category},
                          {"points", std::move(points)},
                          {"group_id", thing.track},
                          {"description", absl::StrCat(thing.category, ".", thing.instance)},
                          {"shape_type", "polygon"},
                          {"flags", ShapeJson::object()},
                          {"mask", nullptr}});
      }
    }
    const std::filesystem::path photograph = scene_.views[view.index];
    const ShapeJson json = {
        {"version", "5.5.0"},           {"flags", ShapeJson::object()},
        {"shapes", std::move(shapes)},  {"imagePath", photograph.filename().string()},
        {"imageData", nullptr},         {"imageHeight", view.size.height},
        {"imageWidth", view.size.width}};
    return zip_.Add(files_[view.index], TextOf(json), ZipWriter::Method::kDeflated);
  }

  absl::Status Finish() override { return absl::OkStatus(); }

 private:
  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> files_;
};

}  // namespace

std::unique_ptr<AnnotationWriter> MakeLabelMeWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<LabelMeWriter>(scene, zip);
}

}  // namespace pepeseg
