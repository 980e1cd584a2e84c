#include "clients/benchmark/outline_files.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using ParsedJson = nlohmann::json;

constexpr int kMaxImageSide = 16384;
constexpr double kMaxPosition = 1e6;  // of a point, on both sides of 0

// Returns the member of an object; null if it has none, or is not an object.
const ParsedJson& Member(const ParsedJson& json, const char* name) {
  static const ParsedJson null;
  const auto found = json.is_object() ? json.find(name) : json.end();
  return found == json.end() ? null : *found;
}

// Returns the text of a value. Bytes that are not UTF-8 are replaced.
std::string TextOf(const ParsedJson& json) {
  return json.dump(-1, ' ', true, ParsedJson::error_handler_t::replace);
}

// Returns at most 60 characters of that text, for errors.
std::string Shown(const ParsedJson& json) {
  const std::string text = TextOf(json);
  return text.size() <= 60 ? text : text.substr(0, 57) + "...";
}

// Returns true if all values are positions that an image may have around it.
bool ArePositions(const ParsedJson& values) {
  return values.is_array() &&
         std::all_of(values.begin(), values.end(), [](const ParsedJson& value) {
           return value.is_number() && std::abs(value.get<double>()) <= kMaxPosition;
         });
}

// Reads one file. Errors name it and the part that is malformed.
class OutlineReader {
 public:
  OutlineReader(fs::path file, std::string name, ParsedJson json)
      : file_(std::move(file)), name_(std::move(name)), json_(std::move(json)) {}

  absl::StatusOr<std::vector<OutlinedPhotograph>> LabelMe();
  absl::StatusOr<std::vector<OutlinedPhotograph>> Coco();

 private:
  // A shape or annotation, for errors.
  struct Part {
    const char* kind;
    size_t index;
  };

  template <typename... Text>
  absl::Status Bad(const Text&... text) const {
    return absl::InvalidArgumentError(absl::StrCat(file_.string(), ": ", text...));
  }
  template <typename... Text>
  absl::Status BadPart(const Part& part, const Text&... text) const {
    return Bad(part.kind, " ", part.index, ": ", text...);
  }

  absl::StatusOr<PixelSize> Size(const ParsedJson& json, const char* width, const char* height,
                                 const std::string& where) const;
  absl::StatusOr<Polygon> Points(const ParsedJson& json, const Part& part) const;
  absl::StatusOr<OutlineRegion> ShapeRegion(const ParsedJson& shape, const Part& part) const;
  absl::StatusOr<OutlineRegion> AnnotationRegion(const ParsedJson& annotation, const Part& part,
                                                 const PixelSize& size) const;
  // Adds a region to the entity of its label and instance. INVALID_ARGUMENT: one of them is
  // malformed, or the photograph has the label already and both have no instance.
  absl::Status Add(const Part& part, const ParsedJson& label, const ParsedJson& instance,
                   OutlineRegion region, OutlinedPhotograph& photograph);

  const fs::path file_;
  const std::string name_;
  const ParsedJson json_;
  std::map<std::pair<const OutlinedPhotograph*, std::string>, size_t> unnumbered_;  // their parts
};

absl::StatusOr<PixelSize> OutlineReader::Size(const ParsedJson& json, const char* width,
                                              const char* height, const std::string& where) const {
  PixelSize size;
  for (const auto& [name, side] : {std::pair(width, &size.width), {height, &size.height}}) {
    const ParsedJson& value = Member(json, name);
    if (!value.is_number_integer() || value < 1 || value > kMaxImageSide) {
      return Bad(where, name, " is ", Shown(value),
                 ": expected the size of the image in pixels, 1 to ", kMaxImageSide);
    }
    *side = value.get<int>();
  }
  return size;
}

// Returns points of LabelMe, [[x, y], ...].
absl::StatusOr<Polygon> OutlineReader::Points(const ParsedJson& json, const Part& part) const {
  Polygon points;
  if (!json.is_array()) return BadPart(part, "points is ", Shown(json), ": expected [[x, y], ...]");
  for (const ParsedJson& point : json) {
    if (!ArePositions(point) || point.size() != 2) {
      return BadPart(part, "point ", points.size(), " is ", Shown(point),
                     ": expected [x, y] in pixels");
    }
    points.push_back({point[0].get<double>(), point[1].get<double>()});
  }
  return points;
}

absl::StatusOr<OutlineRegion> OutlineReader::ShapeRegion(const ParsedJson& shape,
                                                         const Part& part) const {
  const ParsedJson& type = Member(shape, "shape_type");
  ASSIGN_OR_RETURN(const Polygon points, Points(Member(shape, "points"), part));
  if (type == "rectangle" || type == "circle") {
    if (points.size() != 2) {
      return BadPart(part, "a ", type.get<std::string>(), " of ", points.size(),
                     " points: expected 2");
    }
    const bool circle = type == "circle";  // its centre, and a point of it
    return OutlineRegion{{circle ? CircleOf(points[0], points[1]) : BoxOf(points[0], points[1])},
                         {}};
  }
  // Early versions of LabelMe have polygons only, without a type.
  if (!type.is_null() && type != "polygon") {
    return BadPart(part, "shape_type ", Shown(type),
                   " is not read; draw a polygon, a rectangle or a circle");
  }
  if (points.size() < 3) {
    return BadPart(part, "a polygon of ", points.size(),
                   " points: at least 3 are needed; redraw or delete it");
  }
  return OutlineRegion{{points}, {}};
}

absl::Status OutlineReader::Add(const Part& part, const ParsedJson& label,
                                const ParsedJson& instance, OutlineRegion region,
                                OutlinedPhotograph& photograph) {
  if (!label.is_string() || label.get<std::string>().empty()) {
    return BadPart(part, "the label is ", Shown(label), ": expected the name of a thing");
  }
  std::string name = label.get<std::string>();
  if (instance.is_null()) {
    const auto [other, added] = unnumbered_.insert({{&photograph, name}, part.index});
    if (!added) {
      const bool shape = part.kind == absl::string_view("shape");
      return Bad(part.kind, "s ", other->second, " and ", part.index, " are both \"", name,
                 "\" and have no ", shape ? "group_id" : "track_id",
                 ": give each thing a number of its own that it has in all photographs, and the "
                 "parts of one thing the same number");
    }
  } else if (instance.is_number_integer()) {
    absl::StrAppend(&name, ".", TextOf(instance));
  } else if (instance.is_string()) {
    absl::StrAppend(&name, ".", instance.get<std::string>());
  } else {
    return BadPart(part, "the instance is ", Shown(instance), ": expected a number or null");
  }
  auto& entities = photograph.entities;
  auto entity = std::find_if(entities.begin(), entities.end(),
                             [&](const OutlinedEntity& other) { return other.name == name; });
  if (entity == entities.end()) entity = entities.insert(entities.end(), {name, {}});
  entity->regions.push_back(std::move(region));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<OutlinedPhotograph>> OutlineReader::LabelMe() {
  OutlinedPhotograph photograph{name_, file_, {}, {}};
  const ParsedJson& shapes = Member(json_, "shapes");
  if (!shapes.is_array()) return Bad("shapes is ", Shown(shapes), ": expected a list");
  ASSIGN_OR_RETURN(photograph.size, Size(json_, "imageWidth", "imageHeight", ""));
  for (size_t i = 0; i < shapes.size(); ++i) {
    const Part part{"shape", i};
    ASSIGN_OR_RETURN(OutlineRegion region, ShapeRegion(shapes[i], part));
    RETURN_IF_ERROR(Add(part, Member(shapes[i], "label"), Member(shapes[i], "group_id"),
                        std::move(region), photograph));
  }
  return std::vector<OutlinedPhotograph>{std::move(photograph)};
}

absl::StatusOr<OutlineRegion> OutlineReader::AnnotationRegion(const ParsedJson& annotation,
                                                              const Part& part,
                                                              const PixelSize& size) const {
  const ParsedJson& json = Member(annotation, "segmentation");
  if (json.is_object()) {
    OutlineRegion region{{}, RleOf(json)};
    if (!region.rle || PixelSize{region.rle->width(), region.rle->height()} != size) {
      return BadPart(part, "segmentation is ", Shown(json), ": expected \"size\": [", size.height,
                     ", ", size.width, "], as of its image, and \"counts\"");
    }
    const auto mask = DecodeRle(*region.rle);
    if (!mask.ok()) return BadPart(part, "counts: ", mask.status().message());
    return region;
  }
  if (!json.is_array() || json.empty()) {
    return BadPart(part, "segmentation is ", Shown(json),
                   ": expected polygons or run lengths; outline the thing, a box is not enough");
  }
  OutlineRegion region;
  for (const ParsedJson& flat : json) {
    if (!ArePositions(flat) || flat.size() < 6 || flat.size() % 2 != 0) {
      return BadPart(part, "polygon ", region.polygons.size(), " is ", Shown(flat),
                     ": expected [x, y, x, y, ...] of at least 3 points");
    }
    Polygon& polygon = region.polygons.emplace_back();
    for (size_t i = 0; i < flat.size(); i += 2) {
      polygon.push_back({flat[i].get<double>(), flat[i + 1].get<double>()});
    }
  }
  return region;
}

// Returns the instance that an annotation is of; null if it has none.
const ParsedJson& InstanceOf(const ParsedJson& annotation) {
  static const ParsedJson none;
  for (const ParsedJson* object : {&annotation, &Member(annotation, "attributes")}) {
    for (const char* name : {"track_id", "instance_id"}) {
      if (const ParsedJson& instance = Member(*object, name); !instance.is_null()) return instance;
    }
  }
  return none;
}

absl::StatusOr<std::vector<OutlinedPhotograph>> OutlineReader::Coco() {
  std::vector<OutlinedPhotograph> photographs;
  std::map<std::string, size_t> image_of;  // by id
  std::map<std::string, ParsedJson> label_of;
  for (const ParsedJson& image : Member(json_, "images")) {
    const std::string where = absl::StrCat("image ", photographs.size(), ": ");
    const ParsedJson& name = Member(image, "file_name");
    if (!name.is_string()) {
      return Bad(where, "file_name is ", Shown(name), ": expected the name of a photograph");
    }
    ASSIGN_OR_RETURN(const PixelSize size, Size(image, "width", "height", where));
    image_of[TextOf(Member(image, "id"))] = photographs.size();
    photographs.push_back({name.get<std::string>(), file_, size, {}});
  }
  for (const ParsedJson& category : Member(json_, "categories")) {
    label_of[TextOf(Member(category, "id"))] = Member(category, "name");
  }
  const ParsedJson& annotations = Member(json_, "annotations");
  for (size_t i = 0; i < annotations.size(); ++i) {
    const ParsedJson& annotation = annotations[i];
    const Part part{"annotation", i};
    const std::string image_id = TextOf(Member(annotation, "image_id"));
    const std::string category_id = TextOf(Member(annotation, "category_id"));
    const auto image = image_of.find(image_id);
    if (image == image_of.end()) return BadPart(part, "no image has the id ", image_id);
    const auto label = label_of.find(category_id);
    if (label == label_of.end()) return BadPart(part, "no category has the id ", category_id);
    OutlinedPhotograph& photograph = photographs[image->second];
    ASSIGN_OR_RETURN(OutlineRegion region, AnnotationRegion(annotation, part, photograph.size));
    RETURN_IF_ERROR(
        Add(part, label->second, InstanceOf(annotation), std::move(region), photograph));
  }
  return photographs;
}

}  // namespace

std::optional<v1::CocoRle> RleOf(const ParsedJson& json) {
  const ParsedJson& size = Member(json, "size");
  const ParsedJson& counts = Member(json, "counts");
  if (!size.is_array() || size.size() != 2 || !size[0].is_number_integer() ||
      !size[1].is_number_integer() || (!counts.is_string() && !counts.is_array())) {
    return std::nullopt;
  }
  v1::CocoRle rle;
  rle.set_height(size[0].get<int>());
  rle.set_width(size[1].get<int>());
  if (counts.is_string()) {
    rle.set_counts(counts.get<std::string>());
    return rle;
  }
  std::vector<int64_t> runs;
  for (const ParsedJson& run : counts) {
    if (!run.is_number_integer()) return std::nullopt;
    runs.push_back(run.get<int64_t>());
  }
  rle.set_counts(CompressRuns(runs));
  return rle;
}

absl::StatusOr<std::vector<OutlinedPhotograph>> ReadOutlines(const fs::path& path,
                                                             bool refuse_others) {
  std::vector<fs::path> files;
  std::error_code error;
  if (fs::is_regular_file(path, error)) files.push_back(path);
  auto entry = fs::recursive_directory_iterator(path, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (entry->path().extension() == ".json") files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());
  std::vector<OutlinedPhotograph> all;
  for (const fs::path& file : files) {
    ASSIGN_OR_RETURN(const std::string text, ReadFile(file));
    ParsedJson json = ParsedJson::parse(text, nullptr, /*allow_exceptions=*/false);
    const bool label_me = !Member(json, "shapes").is_null();
    const bool coco = Member(json, "images").is_array() && Member(json, "annotations").is_array();
    if (!label_me && !coco) {
      if (!refuse_others) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(file.string(),
                       ": neither outlines of LabelMe (\"shapes\") nor of COCO (\"images\", "
                       "\"annotations\" and \"categories\"); move it elsewhere, or save it again"));
    }
    fs::path name = file == path ? file.filename() : file.lexically_relative(path);
    OutlineReader reader(file, name.replace_extension().generic_string(), std::move(json));
    ASSIGN_OR_RETURN(std::vector<OutlinedPhotograph> read,
                     label_me ? reader.LabelMe() : reader.Coco());
    for (OutlinedPhotograph& photograph : read) {
      if (photograph.entities.empty()) continue;
      if (const OutlinedPhotograph* other = OutlinesOf(all, photograph.name); other != nullptr) {
        return absl::InvalidArgumentError(absl::StrCat(
            file.string(), ": the photograph \"", photograph.name, "\" has outlines already, as \"",
            other->name, "\" in ", other->file.string(), "; keep one of them"));
      }
      all.push_back(std::move(photograph));
    }
  }
  return all;
}

}  // namespace pepeseg::client::cli
