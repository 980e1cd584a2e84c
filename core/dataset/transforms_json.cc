#include "core/dataset/transforms_json.h"

#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/dataset/photo_names.h"
#include "core/formats/colmap.h"
#include "core/formats/file_json.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/transforms_references.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

// The fields of a frame, which take precedence over those of the document.
class Fields {
 public:
  Fields(const json& document, const json& frame) : document_(document), frame_(frame) {}

  // Returns the field, or null if it is missing or JSON's null.
  const json* Find(const char* key) const {
    for (const json* object : {&frame_, &document_}) {
      const auto found = object->find(key);
      if (found != object->end() && !found->is_null()) return &*found;
    }
    return nullptr;
  }

  // Returns the number, or nothing if the field is missing.
  absl::StatusOr<std::optional<double>> Number(const char* key) const {
    const json* value = Find(key);
    if (value == nullptr) return std::optional<double>();
    if (!value->is_number() || !std::isfinite(value->get<double>())) {
      return absl::InvalidArgumentError(absl::StrCat("\"", key, "\" is not a finite number"));
    }
    return std::optional<double>(value->get<double>());
  }

  absl::StatusOr<double> NumberOr(const char* key, double otherwise) const {
    ASSIGN_OR_RETURN(const std::optional<double> value, Number(key));
    return value.value_or(otherwise);
  }

 private:
  const json& document_;
  const json& frame_;
};

// Returns true for a fisheye lens. The pinhole and radial models are special cases of OPENCV with
// coefficients of 0, so they need no code of their own.
absl::StatusOr<bool> IsFisheye(const Fields& fields) {
  const json* flag = fields.Find("is_fisheye");
  const json* model = fields.Find("camera_model");
  const bool flagged = flag != nullptr && flag->is_boolean() && flag->get<bool>();
  if (model == nullptr) return flagged;
  if (!model->is_string()) return absl::InvalidArgumentError("\"camera_model\" is not text");
  const auto& name = model->get_ref<const std::string&>();
  if (name == "OPENCV_FISHEYE") return true;
  for (const char* known : {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL"}) {
    if (name == known) return flagged;
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "\"camera_model\" is ", name,
      ", known are OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, RADIAL and SIMPLE_RADIAL"));
}

// Reads the coefficients and chooses the smallest model that has them. `distortion` is in COLMAP's
// order, which is k1 k2 p1 p2 k3 for the OpenCV models.
absl::Status ReadDistortion(const Fields& fields, Lens& lens) {
  double k[4], p[2];
  for (int i = 0; i < 4; ++i) {
    ASSIGN_OR_RETURN(k[i], fields.NumberOr(absl::StrCat("k", i + 1).c_str(), 0));
  }
  for (int i = 0; i < 2; ++i) {
    ASSIGN_OR_RETURN(p[i], fields.NumberOr(absl::StrCat("p", i + 1).c_str(), 0));
  }
  ASSIGN_OR_RETURN(const bool fisheye, IsFisheye(fields));
  if (fisheye) {
    lens.model = LensModel::kOpencvFisheye;
    lens.distortion = {k[0], k[1], k[2], k[3]};
    return absl::OkStatus();
  }
  if (k[3] != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "\"k4\" is ", k[3], ": a lens that is not a fisheye has only k1, k2, k3, p1 and p2"));
  }
  lens.model = k[2] == 0 ? LensModel::kOpencv : LensModel::kFullOpencv;
  lens.distortion = {k[0], k[1], p[0], p[1], k[2]};
  return absl::OkStatus();
}

// Reads a width or height in pixels; `of_photo` if the field is missing.
absl::StatusOr<int> ReadExtent(const Fields& fields, const char* key, int of_photo) {
  ASSIGN_OR_RETURN(const double size, fields.NumberOr(key, of_photo));
  if (size >= 1 && size <= 1e6 && size == std::floor(size)) return static_cast<int>(size);
  return absl::InvalidArgumentError(
      absl::StrCat("\"", key, "\" is ", size, ", not a whole number of pixels"));
}

// Returns the focal length of one axis in pixels, from its own field or from the field of view, or
// nothing if both are missing. `extent` is the width or height in pixels.
absl::StatusOr<std::optional<double>> FocalOf(const Fields& fields, const char* focal_key,
                                              const char* angle_key, int extent) {
  ASSIGN_OR_RETURN(const std::optional<double> focal, fields.Number(focal_key));
  ASSIGN_OR_RETURN(const std::optional<double> angle, fields.Number(angle_key));
  // The focal length wins where the file has both.
  if (focal || !angle) return focal;
  if (!(*angle > 0 && *angle < M_PI)) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", angle_key, "\" is ", *angle, " radians, not in (0, pi)"));
  }
  return std::optional<double>(extent / (2 * std::tan(*angle / 2)));
}

// Reads the lens of a frame. Opens the photograph only if the fields lack its size.
absl::StatusOr<Lens> ReadLens(const Fields& fields, const DatasetFile& photo) {
  ImageHeader header;
  if (fields.Find("w") == nullptr || fields.Find("h") == nullptr) {
    ASSIGN_OR_RETURN(const std::string bytes, ReadFile(photo.path, photo.name, kMaxImageFileBytes));
    ASSIGN_OR_RETURN(
        header, ReadImageHeader(photo.name,
                                {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}));
  }
  Lens lens;
  ASSIGN_OR_RETURN(lens.width, ReadExtent(fields, "w", header.width));
  ASSIGN_OR_RETURN(lens.height, ReadExtent(fields, "h", header.height));
  ASSIGN_OR_RETURN(const auto fx, FocalOf(fields, "fl_x", "camera_angle_x", lens.width));
  ASSIGN_OR_RETURN(const auto fy, FocalOf(fields, "fl_y", "camera_angle_y", lens.height));
  if (!fx) return absl::InvalidArgumentError("neither \"fl_x\" nor \"camera_angle_x\" is there");
  lens.fx = *fx;
  lens.fy = fy.value_or(*fx);
  ASSIGN_OR_RETURN(lens.cx, fields.NumberOr("cx", lens.width / 2.0));
  ASSIGN_OR_RETURN(lens.cy, fields.NumberOr("cy", lens.height / 2.0));
  RETURN_IF_ERROR(ReadDistortion(fields, lens));
  return lens;
}

// Reads "transform_matrix", and converts its axes.
absl::StatusOr<Pose> ReadPose(const json& frame) {
  const auto matrix = frame.find("transform_matrix");
  Eigen::Matrix4d world_from_cam = Eigen::Matrix4d::Identity();
  const auto refused = absl::InvalidArgumentError(
      "has no \"transform_matrix\" of 4 (or 3) rows of 4 numbers, the last 0 0 0 1");
  if (matrix == frame.end() || !matrix->is_array()) return refused;
  if (matrix->size() != 3 && matrix->size() != 4) return refused;
  for (size_t row = 0; row < matrix->size(); ++row) {
    const json& values = (*matrix)[row];
    if (!values.is_array() || values.size() != 4) return refused;
    for (size_t column = 0; column < 4; ++column) {
      if (!values[column].is_number()) return refused;
      world_from_cam(static_cast<int>(row), static_cast<int>(column)) =
          values[column].get<double>();
    }
  }
  if (!(world_from_cam.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).isZero(1e-6)) return refused;
  // OpenGL's y up and z backwards become y down and z forward.
  const Eigen::Matrix3d axes =
      world_from_cam.topLeftCorner<3, 3>() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return PoseOfAxes(axes, world_from_cam.topRightCorner<3, 1>());
}

// Adds the pose and the lens of each frame.
class FrameReader {
 public:
  FrameReader(const DatasetIndex& index, const json& document, PhotoPoses& poses)
      : index_(index), document_(document), names_(index.photos), poses_(poses) {}

  absl::Status Read(const json& frame) {
    const auto path = frame.is_object() ? frame.find("file_path") : frame.end();
    if (!frame.is_object() || path == frame.end() || !path->is_string()) {
      return absl::InvalidArgumentError("has no \"file_path\"");
    }
    PhotoPose pose;
    pose.name = PlainPath(path->get_ref<const std::string&>());
    RETURN_IF_ERROR(ValidateName(pose.name));
    ASSIGN_OR_RETURN(pose.cam_from_world, ReadPose(frame));
    // A frame without a photograph keeps its path as its name: the import warns of it.
    const std::string key = names_.Find(pose.name);
    if (!key.empty()) {
      ASSIGN_OR_RETURN(const Lens lens, ReadLens(Fields(document_, frame), *index_.photos.at(key)));
      ASSIGN_OR_RETURN(pose.camera_id, AddLens(lens, poses_));
      pose.name = key;
    }
    poses_.photos.push_back(std::move(pose));
    return absl::OkStatus();
  }

 private:
  const DatasetIndex& index_;
  const json& document_;
  PhotoNames names_;
  PhotoPoses& poses_;
};

// Reads and parses the file, and checks that it has a list of frames.
absl::StatusOr<json> ReadDocument(const DatasetFile& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(file.path, file.name, kMaxTransformsBytes));
  const auto refused = [&](absl::string_view why) {
    return absl::InvalidArgumentError(absl::StrCat(file.name, ": ", why));
  };
  absl::StatusOr<json> parsed = ParseFileJson(text);
  if (!parsed.ok()) return refused(parsed.status().message());
  json document = *std::move(parsed);
  if (!document.is_object() || !document.contains("frames") || !document["frames"].is_array()) {
    return refused("has no list of \"frames\"");
  }
  if (document["frames"].size() > static_cast<size_t>(kMaxViews)) {
    return refused(absl::StrCat(document["frames"].size(), " frames, the limit is ", kMaxViews));
  }
  return document;
}

// Warns if nerfstudio has rotated the world.
void NoteTransform(const json& document, PhotoPoses& poses) {
  const auto applied = document.find("applied_transform");
  if (applied == document.end()) return;
  poses.warnings.push_back(absl::StrCat(poses.file,
                                        ": applied_transform is not undone: the scene keeps the "
                                        "orientation that this file gives it"));
}

}  // namespace

absl::StatusOr<PhotoPoses> ReadTransformsJson(const DatasetIndex& index) {
  const DatasetFile& file = *index.transforms;
  ASSIGN_OR_RETURN(const json document, ReadDocument(file));
  PhotoPoses poses;
  poses.file = poses.camera_file = file.name;
  FrameReader reader(index, document, poses);
  const json& frames = document["frames"];
  poses.photos.reserve(frames.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    const absl::Status read = reader.Read(frames[i]);
    if (read.ok()) continue;
    return absl::InvalidArgumentError(absl::StrCat(file.name, ": frame ", i, ": ", read.message()));
  }
  NoteTransform(document, poses);
  return poses;
}

}  // namespace pepeseg
