#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/annotations/format_writers.h"
#include "core/annotations/mask_polygons.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

class YoloWriter final : public AnnotationWriter {
 public:
  YoloWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene),
        zip_(zip),
        categories_(CategoriesOf(scene.things)),
        files_(FilesOfViews(scene, ".txt")) {}

  // Writes "CLASS X1 Y1 X2 Y2 ...", one line for each thing that the view shows, in the order of
  // the things. Parts and holes are joined to one polygon.
  absl::Status Add(const AnnotatedView& view) override {
    const std::string file = absl::StrCat("labels/", files_[view.index]);
    std::string lines;
    int line = 0;
    for (size_t t = 0; t < scene_.things.size(); ++t) {
      if (ShowNothing(view.counts[t], view.size)) continue;
      ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(view.counts[t], view.size));
      const Polygon polygon = Joined(PolygonsOf(mask.pixels, view.size));
      if (polygon.empty()) continue;
      const AnnotatedThing& thing = scene_.things[t];
      const auto category = std::find(categories_.begin(), categories_.end(), thing.category);
      absl::StrAppend(&lines, category - categories_.begin());
      for (const PolygonPoint& point : polygon) {
        absl::StrAppendFormat(&lines, " %.7f %.7f", point.x / view.size.width,
                              point.y / view.size.height);
      }
      lines += "\n";
      absl::StrAppend(&tracks_, file, ",", ++line, ",", thing.track, "\n");
    }
    return zip_.Add(file, lines, ZipWriter::Method::kDeflated);
  }

  absl::Status Finish() override {
    RETURN_IF_ERROR(zip_.Add("tracks.csv", tracks_, ZipWriter::Method::kDeflated));
    RETURN_IF_ERROR(zip_.Add("things.json", ThingsJson(scene_), ZipWriter::Method::kDeflated));
    std::string data =
        "# The photographs belong into images, next to labels.\n"
        "train: images\nval: images\nnames:\n";
    for (size_t i = 0; i < categories_.size(); ++i) {
      // A text in JSON is a text in YAML.
      const std::string name = nlohmann::json(categories_[i])
                                   .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
      absl::StrAppend(&data, "  ", i, ": ", name, "\n");
    }
    return zip_.Add("data.yaml", data, ZipWriter::Method::kDeflated);
  }

  int64_t num_waiting_bytes() const override { return static_cast<int64_t>(tracks_.size()); }

 private:
  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> categories_;
  const std::vector<std::string> files_;
  std::string tracks_ = "file,line,track_id\n";
};

}  // namespace

std::unique_ptr<AnnotationWriter> MakeYoloWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<YoloWriter>(scene, zip);
}

}  // namespace pepeseg
