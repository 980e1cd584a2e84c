#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "core/annotations/format_writers.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

using Json = nlohmann::ordered_json;

class CocoWriter final : public AnnotationWriter {
 public:
  CocoWriter(const AnnotatedScene& scene, ZipWriter& zip)
      : scene_(scene), zip_(zip), categories_(CategoriesOf(scene.things)) {
    json_["info"] = {{"description", absl::StrCat("pepeseg: ", scene.name)}};
    json_["images"] = json_["categories"] = json_["annotations"] = Json::array();
    for (size_t i = 0; i < categories_.size(); ++i) {
      json_["categories"].push_back(
          {{"id", i + 1}, {"name", categories_[i]}, {"supercategory", ""}});
    }
  }

  absl::Status Add(const AnnotatedView& view) override {
    json_["images"].push_back({{"id", view.index + 1},
                               {"file_name", scene_.views[view.index]},
                               {"width", view.size.width},
                               {"height", view.size.height}});
    for (size_t t = 0; t < scene_.things.size(); ++t) {
      RETURN_IF_ERROR(AddMask(view, scene_.things[t], view.counts[t]));
    }
    return absl::OkStatus();
  }

  absl::Status Finish() override {
    return zip_.Add("annotations.json", TextOf(json_), ZipWriter::Method::kDeflated);
  }

  int64_t num_waiting_bytes() const override { return num_bytes_; }

 private:
  absl::Status AddMask(const AnnotatedView& view, const AnnotatedThing& thing,
                       const std::string& counts) {
    if (ShowNothing(counts, view.size)) return absl::OkStatus();
    ASSIGN_OR_RETURN(const BinaryMask mask, MaskOfCounts(counts, view.size));
    const MaskExtent extent = ExtentOf(mask, view.size);
    if (extent.area == 0) return absl::OkStatus();
    const auto category = std::find(categories_.begin(), categories_.end(), thing.category);
    json_["annotations"].push_back(
        {{"id", json_["annotations"].size() + 1},
         {"image_id", view.index + 1},
         {"category_id", category - categories_.begin() + 1},
         {"segmentation", {{"size", {view.size.height, view.size.width}}, {"counts", counts}}},
         {"area", extent.area},
         {"bbox", {extent.x, extent.y, extent.width, extent.height}},
         {"iscrowd", 0},
         {"instance_id", thing.instance},
         {"track_id", thing.track},
         {"label", thing.id}});
    constexpr int64_t kNodes = 4096;  // bytes, about, of an annotation without its run lengths
    num_bytes_ += kNodes + 2 * static_cast<int64_t>(counts.size());
    return absl::OkStatus();
  }

  const AnnotatedScene& scene_;
  ZipWriter& zip_;
  const std::vector<std::string> categories_;
  Json json_;
  int64_t num_bytes_ = 0;
};

}  // namespace

std::unique_ptr<AnnotationWriter> MakeCocoWriter(const AnnotatedScene& scene, ZipWriter& zip) {
  return std::make_unique<CocoWriter>(scene, zip);
}

}  // namespace pepeseg
