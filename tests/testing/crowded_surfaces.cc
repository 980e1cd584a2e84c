#include "tests/testing/crowded_surfaces.h"

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

namespace pepeseg::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPartContrast = 0.05;

const Vector3d kSkin = {0.85, 0.62, 0.48}, kShirt = {0.25, 0.42, 0.65};
const Vector3d kTrousers = {0.3, 0.3, 0.36}, kShoe = {0.24, 0.18, 0.15};

Matrix3d Turn(const Vector3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis).toRotationMatrix();
}

void StartObject(CrowdedSurfaces& out, const std::string& name) {
  out.object_names.push_back(name);
}

// Adds a part of the object that was started last. Sets its label and a shade that no other part
// has.
void AddPart(CrowdedSurfaces& out, const std::string& name, Surface surface) {
  const size_t part = out.part_names.size();
  surface.label = static_cast<int>(part);
  surface.color *= 0.97 + 0.06 * std::fmod(0.618034 * static_cast<double>(part), 1.0);
  surface.contrast = kPartContrast;
  out.surfaces.push_back(surface);
  out.part_names.push_back(name);
  out.object_of_part.push_back(static_cast<uint16_t>(out.object_names.size() - 1));
}

void AddSurroundings(CrowdedSurfaces& out) {
  const Vector3d screen = {0.55, 0.6, 0.7};
  out.surfaces.push_back({0, false, {0, 0.1, 0}, {7, 0.1, 7}, {0.75, 0.65, 0.5}});
  out.surfaces.push_back({0, false, {0, -1.5, 1.8}, {2.2, 1.5, 0.1}, screen});
  for (const int side : {-1, 1}) {
    Surface panel = {0, false, {side * 3.4, -1.5, 0.3}, {2.2, 1.5, 0.1}, screen};
    panel.axes_from_world = Turn(Vector3d::UnitY(), -side * 50);
    out.surfaces.push_back(panel);
  }
  out.part_names.emplace_back();
  out.object_names.emplace_back();
  out.object_of_part.push_back(0);
}

// Five courses of six blocks, each shifted by half a block against the one below.
void AddWall(CrowdedSurfaces& out) {
  const std::array<Vector3d, 3> colors = {
      {{0.7, 0.4, 0.3}, {0.68, 0.44, 0.33}, {0.72, 0.62, 0.42}}};
  const std::array<std::string_view, 5> courses = {"001122", "000112", "110000", "221001",
                                                   "002211"};
  const Vector3d half = {0.125, 0.09, 0.14};
  StartObject(out, "wall");
  for (size_t row = 0; row < courses.size(); ++row) {
    for (size_t column = 0; column < courses[row].size(); ++column) {
      const double x = -1.55 + half.x() * (2 * double(column) + 0.5 + double(row % 2));
      const double y = -half.y() * (2 * double(row) + 1);
      AddPart(out, "block_" + std::to_string(row + 1) + "_" + std::to_string(column + 1),
              {0, false, {x, y, 0.2}, half, colors[courses[row][column] - '0']});
    }
  }
}

struct Limb {
  const char* name;
  double x, top, z;  // of the upper end's middle; x on the right-hand side
  Vector3d half;
  double degrees;  // outwards from straight down
  Vector3d color;
};

void AddFigure(CrowdedSurfaces& out) {
  const Vector3d at = {0.2, 0, -0.5};
  const std::array<Limb, 5> limbs = {{
      {"upper_arm", 0.25, -1.24, 0, {0.06, 0.17, 0.06}, 30, kShirt},
      {"lower_arm", 0.42, -0.95, 0, {0.055, 0.16, 0.055}, 10, kSkin},
      {"thigh", 0.11, -0.72, 0, {0.09, 0.16, 0.09}, 0, kTrousers},
      {"shin", 0.11, -0.4, 0, {0.07, 0.15, 0.07}, 0, kTrousers},
      {"foot", 0.11, -0.1, -0.07, {0.08, 0.05, 0.15}, 0, kShoe},
  }};
  StartObject(out, "figure");
  AddPart(out, "head", {0, true, at + Vector3d(0, -1.42, 0), {0.15, 0.15, 0.15}, kSkin});
  AddPart(out, "torso", {0, false, at + Vector3d(0, -1.08, 0), {0.22, 0.2, 0.11}, kShirt});
  AddPart(out, "hips", {0, false, at + Vector3d(0, -0.8, 0), {0.21, 0.08, 0.11}, kTrousers});
  for (const int side : {-1, 1}) {
    for (const Limb& limb : limbs) {
      const Matrix3d turn = Turn(Vector3d::UnitZ(), -side * limb.degrees);
      const Vector3d middle =
          Vector3d(side * limb.x, limb.top, limb.z) + turn * Vector3d(0, limb.half.y(), 0);
      Surface box = {0, false, at + middle, limb.half, limb.color};
      box.axes_from_world = turn.transpose();
      AddPart(out, std::string(side < 0 ? "left_" : "right_") + limb.name, box);
    }
  }
}

void AddBooks(CrowdedSurfaces& out) {
  const std::array<Vector3d, 2> colors = {{{0.5, 0.22, 0.2}, {0.48, 0.26, 0.2}}};
  const std::string_view bindings = "0010110100";
  StartObject(out, "books");
  double left = 0.65;
  for (size_t book = 0; book < bindings.size(); ++book) {
    const double half_width = 0.04 + 0.004 * double(book * 3 % 4);
    const double half_height = 0.3 + 0.01 * double(book * 7 % 5);
    AddPart(out, "book_" + std::to_string(book + 1),
            {0,
             false,
             {left + half_width, -half_height, 0.15},
             {half_width, half_height, 0.2},
             colors[bindings[book] - '0']});
    left += 2 * half_width;
  }
}

}  // namespace

CrowdedSurfaces MakeCrowdedSurfaces() {
  CrowdedSurfaces out;
  AddSurroundings(out);
  AddWall(out);
  AddFigure(out);
  AddBooks(out);
  return out;
}

}  // namespace pepeseg::testing
