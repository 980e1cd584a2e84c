#include "core/annotations/annotation_writer.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "core/annotations/format_writers.h"

namespace pepeseg {

namespace fs = std::filesystem;

std::unique_ptr<AnnotationWriter> MakeAnnotationWriter(AnnotationFormat format,
                                                       const AnnotatedScene& scene,
                                                       ZipWriter& zip) {
  switch (format) {
    case AnnotationFormat::kCoco:
      return MakeCocoWriter(scene, zip);
    case AnnotationFormat::kYolo:
      return MakeYoloWriter(scene, zip);
    case AnnotationFormat::kLabelMe:
      return MakeLabelMeWriter(scene, zip);
    case AnnotationFormat::kMasks:
      return MakeMaskWriter(scene, zip);
    case AnnotationFormat::kCvat:
      return MakeCvatWriter(scene, zip);
    case AnnotationFormat::kIds:
      return MakeIdWriter(scene, zip);
  }
  return nullptr;
}

std::vector<std::string> FilesOfViews(const AnnotatedScene& scene, const std::string& suffix) {
  const auto stem = [](const std::string& view) {
    const fs::path path = fs::path(view).lexically_normal();
    if (!path.is_absolute() && !path.empty() && *path.begin() != "..") {
      return fs::path(path).replace_extension().generic_string();
    }
    std::string name = fs::path(view).replace_extension().generic_string();
    std::replace(name.begin(), name.end(), '/', '-');
    return name.empty() || name.front() == '.' ? "view" + name : name;
  };
  std::map<std::string, int> count;
  for (const std::string& view : scene.views) ++count[stem(view)];
  std::vector<std::string> files;
  for (const std::string& view : scene.views) {
    const std::string name = stem(view);
    files.push_back(name + (count[name] > 1 ? fs::path(view).extension().string() : "") + suffix);
  }
  return files;
}

std::string TextOf(const nlohmann::ordered_json& json) {
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string ThingsJson(const AnnotatedScene& scene) {
  nlohmann::ordered_json things = nlohmann::ordered_json::array();
  for (const AnnotatedThing& thing : scene.things) {
    things.push_back({{"label", thing.id},
                      {"text", thing.text},
                      {"category", thing.category},
                      {"instance_id", thing.instance},
                      {"track_id", thing.track}});
  }
  return TextOf(things);
}

}  // namespace pepeseg
