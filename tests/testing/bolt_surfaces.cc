#include "tests/testing/bolt_surfaces.h"

#include <array>
#include <cmath>
#include <numbers>

namespace pepeseg::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kFront = 0.5;  // of the panel, world z; the viewer is at lower z
constexpr double kSurfaceContrast = 0.05;
constexpr int kColumns = 9, kRows = 4;

const Vector3d kSteel = {0.45, 0.46, 0.5}, kBrass = {0.62, 0.5, 0.3};
const Vector3d kBlue = {0.2, 0.3, 0.6}, kYellow = {0.75, 0.68, 0.25};

// What is at each place of the panel: bolt, knob, pad, lone head of a bolt.
constexpr std::array<const char*, kRows> kPlaces = {"bbkbpbbhb", "pbbhkbbpk", "bkbbpbhbb",
                                                    "kbpbbhbkp"};

void AddPiece(CrowdedSurfaces& out, const std::string& name, Surface surface) {
  surface.label = static_cast<int>(out.part_names.size());
  surface.contrast = kSurfaceContrast;
  out.surfaces.push_back(surface);
  out.part_names.push_back(name);
  out.object_of_part.push_back(static_cast<uint16_t>(out.object_names.size() - 1));
}

// A third of a ball looks out of what is behind it.
Surface Head(const Vector3d& at, double depth) {
  return {0, true, at + Vector3d(0, 0, -depth), Vector3d::Constant(0.085), kSteel};
}

void AddThing(CrowdedSurfaces& out, char kind, int number, const Vector3d& at, double turn) {
  const Matrix3d turned = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix();
  const std::string index = "_" + std::to_string(number);
  Surface box = {0, false, at, {0.11, 0.11, 0.025}, kBrass};
  box.axes_from_world = turned;
  switch (kind) {
    case 'b':
      out.object_names.push_back("bolt" + index);
      AddPiece(out, "washer" + index, box);
      return AddPiece(out, "head" + index, Head(at, 0.03));
    case 'k':
      out.object_names.push_back("knob" + index);
      return AddPiece(out, "knob" + index, {0, true, at, Vector3d::Constant(0.14), kBlue});
    case 'p':
      out.object_names.push_back("pad" + index);
      box.color = kYellow;
      return AddPiece(out, "pad" + index, box);
    default:
      out.object_names.push_back("lone" + index);
      return AddPiece(out, "lone" + index, Head(at, 0));
  }
}

}  // namespace

CrowdedSurfaces MakeBoltSurfaces() {
  CrowdedSurfaces out;
  const Vector3d screen = {0.55, 0.6, 0.7}, panel = {0.6, 0.62, 0.6};
  out.part_names.emplace_back();
  out.object_names.emplace_back();
  out.object_of_part.push_back(0);
  out.surfaces.push_back({0, false, {0, 0.1, 0}, {7, 0.1, 7}, {0.75, 0.65, 0.5}});
  out.surfaces.push_back({0, false, {0, -1.5, 1.8}, {4, 1.5, 0.1}, screen});
  out.object_names.emplace_back("panel");
  AddPiece(out, "panel", {0, false, {0, -0.8, kFront + 0.1}, {1.65, 0.8, 0.1}, panel});
  int number = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column, ++number) {
      // Fractions of multiples of irrational numbers are spread evenly but in no visible order.
      const double a = std::fmod(number * std::numbers::phi, 1.0);
      const double b = std::fmod(number * std::numbers::sqrt2, 1.0);
      const Vector3d at = {-1.44 + 0.36 * column + 0.06 * (a - 0.5),
                           -1.36 + 0.37 * row + 0.06 * (b - 0.5), kFront};
      AddThing(out, kPlaces[row][column], number, at, a * std::numbers::pi / 2);
    }
  }
  return out;
}

}  // namespace pepeseg::testing
