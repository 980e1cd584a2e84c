#include "core/model_files/model_facts.h"

#include <cmath>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/file_json.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

constexpr int kVersion = 1;

json FormatScores(const ImageScores& scores) {
  json object = {{"psnr", scores.psnr}, {"ssim", scores.ssim}};
  if (scores.lpips) object["lpips"] = *scores.lpips;
  return object;
}

json FormatPhotograph(const Photograph& photograph) {
  const Lens& lens = photograph.lens;
  return {{"lens", std::string(NameOf(lens.model))},
          {"width", lens.width},
          {"height", lens.height},
          {"focal", {lens.fx, lens.fy}},
          {"principal_point", {lens.cx, lens.cy}},
          {"distortion", lens.distortion},
          {"orientation", photograph.orientation},
          {"part", {photograph.left, photograph.top, photograph.width, photograph.height}}};
}

// Formats a view. Optional parts are left out if the view lacks them.
json FormatView(const ModelView& view) {
  const Eigen::Quaterniond& q = view.cam_from_world.rotation;
  const Eigen::Vector3d& t = view.cam_from_world.translation;
  json object = {{"name", view.name},
                 {"width", view.camera.width},
                 {"height", view.camera.height},
                 {"focal", {view.camera.fx, view.camera.fy}},
                 {"principal_point", {view.camera.cx, view.camera.cy}},
                 // World to camera, w first; the translation is in scene units, relative to the
                 // model's origin.
                 {"rotation", {q.w(), q.x(), q.y(), q.z()}},
                 {"translation", {t.x(), t.y(), t.z()}},
                 {"held_out", view.held_out}};
  if (view.scores) object["scores"] = FormatScores(*view.scores);
  if (view.photograph) object["photograph"] = FormatPhotograph(*view.photograph);
  return object;
}

// Returns DATA_LOSS for a part of the text. The caller adds the file's name.
absl::Status Malformed(absl::string_view what) {
  return absl::DataLossError(absl::StrCat(what, " is malformed"));
}

// The functions Take... and Parse... below return false if a key is missing or its value is
// malformed.
bool TakeInt(const json& object, const char* key, int& value) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number_integer()) return false;
  // Refuses numbers that int cannot hold.
  const auto wide = found->get<int64_t>();
  value = static_cast<int>(wide);
  return value == wide;
}

// Reads an array of exactly as many finite numbers as `values` has elements.
template <class Values>
bool TakeNumbers(const json& object, const char* key, Values& values) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array() || found->size() != std::size(values)) {
    return false;
  }
  for (size_t i = 0; i < std::size(values); ++i) {
    if (!(*found)[i].is_number()) return false;
    values[i] = (*found)[i].get<double>();
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

bool ParseScores(const json& value, ImageScores& scores) {
  if (!value.is_object()) return false;
  // "lpips" may be missing: not every server has its weights.
  const auto number = [&value](const char* key) -> std::optional<double> {
    const auto found = value.find(key);
    if (found == value.end() || !found->is_number()) return std::nullopt;
    return found->get<double>();
  };
  const std::optional<double> psnr = number("psnr"), ssim = number("ssim");
  if (!psnr || !ssim) return false;
  scores = {*psnr, *ssim, number("lpips")};
  return true;
}

bool ParsePhotograph(const json& value, Photograph& photograph) {
  if (!value.is_object()) return false;
  Lens& lens = photograph.lens;
  const auto name = value.find("lens");
  if (name == value.end() || !name->is_string()) return false;
  const std::optional<LensModel> model = LensModelByName(name->get<std::string>());
  double focal[2], center[2], part[4];
  if (!model || !TakeInt(value, "width", lens.width) || !TakeInt(value, "height", lens.height) ||
      !TakeNumbers(value, "focal", focal) || !TakeNumbers(value, "principal_point", center) ||
      !TakeNumbers(value, "distortion", lens.distortion) ||
      !TakeInt(value, "orientation", photograph.orientation) || !TakeNumbers(value, "part", part)) {
    return false;
  }
  lens.model = *model;
  lens.fx = focal[0], lens.fy = focal[1];
  lens.cx = center[0], lens.cy = center[1];
  int* const sides[] = {&photograph.left, &photograph.top, &photograph.width, &photograph.height};
  for (size_t i = 0; i < std::size(sides); ++i) {
    // Keeps the conversion to int defined; Validate checks the rectangle.
    if (!(std::abs(part[i]) <= 1e6)) return false;
    *sides[i] = static_cast<int>(part[i]);
  }
  return Validate(photograph).ok();
}

bool ParseView(const json& value, ModelView& view) {
  if (!value.is_object()) return false;
  const auto name = value.find("name");
  const auto held_out = value.find("held_out");
  if (name == value.end() || !name->is_string()) return false;
  if (held_out == value.end() || !held_out->is_boolean()) return false;
  view.name = name->get<std::string>();
  view.held_out = held_out->get<bool>();
  const auto scores = value.find("scores");
  if (scores != value.end() && !ParseScores(*scores, view.scores.emplace())) return false;
  const auto photograph = value.find("photograph");
  if (photograph != value.end() && !ParsePhotograph(*photograph, view.photograph.emplace())) {
    return false;
  }
  double focal[2], center[2], q[4], t[3];
  if (!TakeInt(value, "width", view.camera.width) ||
      !TakeInt(value, "height", view.camera.height) || !TakeNumbers(value, "focal", focal) ||
      !TakeNumbers(value, "principal_point", center) || !TakeNumbers(value, "rotation", q) ||
      !TakeNumbers(value, "translation", t)) {
    return false;
  }
  const int width = view.camera.width, height = view.camera.height;
  view.camera = {width, height, focal[0], focal[1], center[0], center[1]};
  view.cam_from_world.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  view.cam_from_world.translation = Eigen::Vector3d(t);
  // The tolerance allows for decimal rounding of the quaternion.
  return width > 0 && height > 0 && focal[0] > 0 && focal[1] > 0 &&
         std::abs(view.cam_from_world.rotation.norm() - 1) < 1e-3;
}

// Parses the list of views. A view that is malformed is named by its index.
absl::Status ParseViews(const json& document, Model& model) {
  const auto views = document.find("views");
  if (views == document.end() || !views->is_array()) return Malformed("\"views\"");
  for (const json& value : *views) {
    ModelView view;
    if (!ParseView(value, view)) return Malformed(absl::StrCat("view ", model.views.size()));
    model.views.push_back(std::move(view));
  }
  return absl::OkStatus();
}

// Parses "metrics", numbers by name, and "facts", texts by name.
absl::Status ParseMaps(const json& document, Model& model) {
  const auto metrics = document.find("metrics");
  const auto facts = document.find("facts");
  if (metrics == document.end() || !metrics->is_object()) return Malformed("\"metrics\"");
  if (facts == document.end() || !facts->is_object()) return Malformed("\"facts\"");
  for (const auto& [key, value] : metrics->items()) {
    if (!value.is_number()) return Malformed(absl::StrCat("metric ", key));
    model.metrics[key] = value.get<double>();
  }
  for (const auto& [key, value] : facts->items()) {
    if (!value.is_string()) return Malformed(absl::StrCat("fact ", key));
    model.facts[key] = value.get<std::string>();
  }
  return absl::OkStatus();
}

}  // namespace

std::string FormatModelFacts(const Model& model) {
  json views = json::array();
  for (const ModelView& view : model.views) views.push_back(FormatView(view));
  json metrics = json::object();
  for (const auto& [key, value] : model.metrics) {
    // JSON has no NaN and no infinity: they would be written as null and refused when read.
    if (std::isfinite(value)) metrics[key] = value;
  }
  json document = {{"version", kVersion},
                   {"scene_radius", model.scene_radius},
                   {"metrics", std::move(metrics)},
                   {"facts", model.facts},
                   {"views", std::move(views)}};
  const Eigen::Vector3d& o = model.origin;
  // Left out where it is zero.
  if (!o.isZero(0)) document["origin"] = {o.x(), o.y(), o.z()};
  // Replaces invalid UTF-8. By default dump() throws.
  return document.dump(1, ' ', false, json::error_handler_t::replace) + "\n";
}

absl::Status ParseModelFacts(absl::string_view text, Model& model) {
  const absl::StatusOr<json> parsed = ParseFileJson(text);
  if (!parsed.ok()) return absl::DataLossError(parsed.status().message());
  const json& document = *parsed;
  if (!document.is_object()) return absl::DataLossError("is not a JSON object");
  const auto version = document.find("version");
  if (version == document.end() || *version != kVersion) {
    return absl::DataLossError(absl::StrCat("is not of version ", kVersion));
  }
  const auto radius = document.find("scene_radius");
  if (radius == document.end() || !radius->is_number()) return Malformed("\"scene_radius\"");
  model.scene_radius = radius->get<double>();
  // The near plane is a share of the radius and must be over 0.
  if (!(model.scene_radius > 0)) return Malformed("\"scene_radius\"");
  double origin[3] = {};
  if (document.contains("origin") && !TakeNumbers(document, "origin", origin)) {
    return Malformed("\"origin\"");
  }
  model.origin = Eigen::Vector3d(origin);
  RETURN_IF_ERROR(ParseMaps(document, model));
  return ParseViews(document, model);
}

}  // namespace pepeseg
