#include "core/formats/gaussian_html.h"

#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/formats/splat_page.h"
#include "core/formats/y_up.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using Json = nlohmann::ordered_json;

// Where the template has the base64 of the SPZ.
constexpr absl::string_view kGaussians = "{{gaussians}}";

// Returns text as that of an element or of an attribute in quotes.
std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

// Returns a vector of the world in the axes of an SPZ.
Eigen::Vector3d YUp(const Eigen::Vector3d& vector) {
  return vector.cwiseProduct(Eigen::Vector3d(kYUpMean[0], kYUpMean[1], kYUpMean[2]));
}

Json ArrayOf(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

// The camera as the page's script reads it. A JSON of numbers needs no escapes in HTML.
Json CameraOf(const SplatPage& page) {
  const Eigen::Matrix3d rotation = page.cam_from_world.rotation.toRotationMatrix();
  Json axes = Json::array();
  for (int k = 0; k < 3; ++k) axes.push_back(ArrayOf(YUp(rotation.row(k).transpose())));
  return {{"width", page.camera.width},
          {"height", page.camera.height},
          {"fx", page.camera.fx},
          {"fy", page.camera.fy},
          {"cx", page.camera.cx},
          {"cy", page.camera.cy},
          {"rotation", std::move(axes)},
          {"position", ArrayOf(YUp(page.cam_from_world.Inverse().translation))},
          {"up", ArrayOf(YUp(page.up))},
          {"near", page.near}};
}

// Returns a number with commas between thousands.
std::string WithCommas(int64_t number) {
  std::string digits = absl::StrCat(number);
  for (size_t from_end = 3; from_end < digits.size(); from_end += 4) {
    digits.insert(digits.size() - from_end, ",");
  }
  return digits;
}

}  // namespace

SplatPage SplatPageOf(const Model& model, std::string title) {
  SplatPage page;
  page.title = std::move(title);
  page.near = 0.01 * model.scene_radius;
  if (model.views.empty()) {
    page.camera = {.width = 1024, .height = 768, .fx = 800, .fy = 800, .cx = 512, .cy = 384};
    page.cam_from_world.translation.z() = 2 * model.scene_radius;
    return page;
  }
  page.camera = model.views.front().camera;
  page.cam_from_world = model.views.front().cam_from_world;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const ModelView& view : model.views) {
    up -= view.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitY();
  }
  // Views all around, of which no direction is up, leave that of the first.
  if (up.norm() < 0.1 * static_cast<double>(model.views.size())) {
    up = -(page.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitY());
  }
  page.up = up.normalized();
  return page;
}

GaussianHtmlBlocks::GaussianHtmlBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                                       const SplatPage& page)
    : GaussianSpzBlocks(gaussians, std::move(indices), /*max_sh_degree=*/0) {
  const absl::string_view text = kSplatPage;
  const size_t at = text.find(kGaussians);
  // The end of the template has no other names to replace, nor would a title that looks like one.
  start_ = absl::StrReplaceAll(text.substr(0, at), {{"{{title}}", Escaped(page.title)},
                                                    {"{{count}}", WithCommas(num_gaussians())},
                                                    {"{{camera}}", CameraOf(page).dump()}});
  end_ = std::string(text.substr(at + kGaussians.size()));
}

std::string GaussianHtmlBlocks::Encode(int64_t block) const {
  if (block == 0) return start_;
  if (block + 1 == num_blocks()) return end_;
  return absl::Base64Escape(GaussianSpzBlocks::Encode(block - 1)) + "\n";
}

}  // namespace pepeseg
