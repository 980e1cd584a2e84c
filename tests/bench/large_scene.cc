#include "tests/bench/large_scene.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <utility>

namespace pepeseg {
namespace {

constexpr int kLeafPieces = 4;
constexpr float kLargeExtent = 2;  // metres; larger pieces would blow up the hierarchy

// Half sizes of the axis-aligned box around a piece.
Eigen::Vector3f Extent(const Piece& piece) {
  Eigen::Matrix3f to_unit;
  const Float3 rows[3] = {piece.to_unit.row0, piece.to_unit.row1, piece.to_unit.row2};
  for (int k = 0; k < 3; ++k) to_unit.row(k) << rows[k].x, rows[k].y, rows[k].z;
  const Eigen::Matrix3f from_unit = to_unit.inverse();
  return piece.is_box ? Eigen::Vector3f(from_unit.cwiseAbs().rowwise().sum())
                      : Eigen::Vector3f(from_unit.rowwise().norm());
}

}  // namespace

LargeScene::LargeScene(Place place, uint64_t seed, const LeftOut& left_out)
    : has_sky_(place == Place::kYard),
      unseen_(static_cast<uint16_t>(left_out.keeps_shadow ? left_out.thing : 0)),
      to_lamp_(Normalize(Float3{0.5f, -0.75f, -0.43f})) {
  PlacePieces made = MakePlace(place, seed);
  num_things_ = made.num_things;
  materials_ = std::move(made.materials);
  pieces_ = std::move(made.pieces);
  if (left_out.thing != 0 && !left_out.keeps_shadow) {
    std::erase_if(pieces_, [&](const Piece& piece) { return piece.thing == left_out.thing; });
  }
  const auto small = std::partition(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
    return Extent(piece).maxCoeff() > kLargeExtent;
  });
  num_large_ = static_cast<int>(small - pieces_.begin());
  BuildNode(num_large_, static_cast<int>(pieces_.size()));
}

// Splits at the median of the centres along the longest side.
void LargeScene::BuildNode(int first, int end) {
  Eigen::Vector3f low = Eigen::Vector3f::Constant(kFar), high = -low;  // of the pieces
  Eigen::Vector3f first_center = low, last_center = high;
  for (int i = first; i < end; ++i) {
    const Float3 c = pieces_[i].center;
    const Eigen::Vector3f center(c.x, c.y, c.z), extent = Extent(pieces_[i]);
    low = low.cwiseMin(center - extent);
    high = high.cwiseMax(center + extent);
    first_center = first_center.cwiseMin(center);
    last_center = last_center.cwiseMax(center);
  }
  const auto index = static_cast<int>(nodes_.size());
  nodes_.push_back(
      {{low.x(), low.y(), low.z()}, {high.x(), high.y(), high.z()}, first, end - first});
  if (end - first <= kLeafPieces) return;
  int axis = 0;
  (last_center - first_center).maxCoeff(&axis);
  const int middle = (first + end) / 2;
  std::nth_element(
      pieces_.begin() + first, pieces_.begin() + middle, pieces_.begin() + end,
      [axis](const Piece& a, const Piece& b) { return At(a.center, axis) < At(b.center, axis); });
  BuildNode(first, middle);
  nodes_[index].first = static_cast<int>(nodes_.size());
  nodes_[index].count = 0;
  BuildNode(middle, end);
}

ScenePicture PhotographScene(const LargeScene& scene, const SceneCamera& camera) {
  const int64_t num_pixels = int64_t{camera.width} * camera.height;
  ScenePicture out = {std::vector<uint8_t>(3 * num_pixels), std::vector<uint16_t>(num_pixels)};
  for (int64_t i = 0; i < num_pixels; ++i) {
    PhotographPixel(scene.spans(), camera, static_cast<int>(i % camera.width),
                    static_cast<int>(i / camera.width), &out.bgr[3 * i], &out.labels[i]);
  }
  return out;
}

}  // namespace pepeseg
