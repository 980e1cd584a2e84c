#include "tests/bench/large_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tests/bench/large_scene_pieces.h"

namespace pepeseg {
namespace {

using Eigen::Vector3f;

constexpr int kLeafPieces = 4;
constexpr float kLargeExtent = 2;  // metres; larger pieces would blow up the hierarchy
constexpr float kFar = 1e9f;
constexpr float kOff = 1e-3f;  // rays from a surface begin this far from it, metres
constexpr float kAmbient = 0.45f;

float Hash(int x, int y, int z) {
  uint32_t h = static_cast<uint32_t>(x) * 0x8da6b343u ^ static_cast<uint32_t>(y) * 0xd8163841u ^
               static_cast<uint32_t>(z) * 0xcb1ab31fu;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h ^= h >> 13;
  return static_cast<float>(h & 0xffffffu) / static_cast<float>(0xffffff);
}

// Noise in [0, 1] with spots of size 1, smooth.
float SmoothNoise(const Vector3f& p) {
  const Vector3f base = p.array().floor();
  const Eigen::Vector3i cell = base.cast<int>();
  const Vector3f t = p - base;
  const Vector3f s = t.array().square() * (3 - 2 * t.array());
  float corners[8];
  for (int k = 0; k < 8; ++k) {
    corners[k] = Hash(cell.x() + (k & 1), cell.y() + (k >> 1 & 1), cell.z() + (k >> 2));
  }
  const auto mix = [](float a, float b, float share) { return a + share * (b - a); };
  const auto face = [&](const float* c) {
    return mix(mix(c[0], c[1], s.x()), mix(c[2], c[3], s.x()), s.y());
  };
  return mix(face(corners), face(corners + 4), s.z());
}

// Sum of noise from `size` down to the footprint of a pixel, in [0, 1].
float Fractal(const Vector3f& p, float size, float footprint) {
  float sum = 0.5f, weight = 0.5f;
  for (int octave = 0; octave < 8 && size > footprint; ++octave, size *= 0.5f, weight *= 0.8f) {
    const float shift = 17.3f * static_cast<float>(octave);
    sum += weight * (SmoothNoise(p / size + Vector3f::Constant(shift)) - 0.5f);
  }
  return std::clamp(sum, 0.0f, 1.0f);
}

std::optional<LargeHit> Meet(const Piece& piece, const Vector3f& origin,
                             const Vector3f& direction) {
  const Vector3f o = piece.to_unit * (origin - piece.center), d = piece.to_unit * direction;
  Vector3f normal;
  float distance;
  if (piece.is_box) {
    float enter = -kFar, leave = kFar;
    int axis = 0;
    for (int k = 0; k < 3; ++k) {
      const float inv = 1 / d[k];
      const float first = std::min((-1 - o[k]) * inv, (1 - o[k]) * inv);
      const float last = std::max((-1 - o[k]) * inv, (1 - o[k]) * inv);
      if (first > enter) enter = first, axis = k;
      leave = std::min(leave, last);
    }
    if (enter <= 0 || enter > leave) return std::nullopt;
    distance = enter;
    normal = piece.to_unit.row(axis).transpose() * (d[axis] > 0 ? -1.0f : 1.0f);
  } else {
    const float a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - 1;
    const float root = b * b - a * c;
    if (root < 0 || c < 0) return std::nullopt;
    distance = (-b - std::sqrt(root)) / a;
    if (distance <= 0) return std::nullopt;
    normal = piece.to_unit.transpose() * (o + distance * d);
  }
  return LargeHit{distance, &piece, normal.normalized()};
}

// Half sizes of the axis-aligned box around a piece.
Vector3f Extent(const Piece& piece) {
  const Eigen::Matrix3f from_unit = piece.to_unit.inverse();
  return piece.is_box ? Vector3f(from_unit.cwiseAbs().rowwise().sum())
                      : Vector3f(from_unit.rowwise().norm());
}

}  // namespace

LargeScene::LargeScene(Place place, uint64_t seed)
    : place_(place), to_lamp_(Vector3f(0.5f, -0.75f, -0.43f).normalized()) {
  PlacePieces made = MakePlace(place, seed);
  num_things_ = made.num_things;
  materials_ = std::move(made.materials);
  pieces_ = std::move(made.pieces);
  const auto small = std::partition(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
    return Extent(piece).maxCoeff() > kLargeExtent;
  });
  num_large_ = static_cast<int>(small - pieces_.begin());
  BuildNode(num_large_, static_cast<int>(pieces_.size()), 0);
}

// Splits at the median of the centres along the longest side.
void LargeScene::BuildNode(int first, int end, int depth) {
  const auto index = static_cast<int>(nodes_.size());
  nodes_.push_back({Vector3f::Constant(kFar), Vector3f::Constant(-kFar), first, end - first});
  Vector3f low = Vector3f::Constant(kFar), high = -low;  // of the centres
  for (int i = first; i < end; ++i) {
    const Vector3f extent = Extent(pieces_[i]);
    nodes_[index].low = nodes_[index].low.cwiseMin(pieces_[i].center - extent);
    nodes_[index].high = nodes_[index].high.cwiseMax(pieces_[i].center + extent);
    low = low.cwiseMin(pieces_[i].center);
    high = high.cwiseMax(pieces_[i].center);
  }
  if (end - first <= kLeafPieces || depth > 40) return;
  int axis = 0;
  (high - low).maxCoeff(&axis);
  const int middle = (first + end) / 2;
  std::nth_element(pieces_.begin() + first, pieces_.begin() + middle, pieces_.begin() + end,
                   [axis](const Piece& a, const Piece& b) { return a.center[axis] < b.center[axis]; });
  BuildNode(first, middle, depth + 1);
  nodes_[index].first = static_cast<int>(nodes_.size());
  nodes_[index].count = 0;
  BuildNode(middle, end, depth + 1);
}

// Returns the nearest hit up to `most`; with `any` the first one that is found.
std::optional<LargeHit> LargeScene::Walk(const Vector3f& origin, const Vector3f& direction,
                                         float most, bool any) const {
  const Eigen::Array3f inverse = direction.cwiseInverse().array();
  const Eigen::Array3f start = origin.array() * inverse;
  std::optional<LargeHit> nearest;
  const auto meet = [&](int first, int count) {
    for (int i = first; i < first + count; ++i) {
      const auto hit = Meet(pieces_[i], origin, direction);
      if (!hit || hit->distance >= most) continue;
      nearest = hit;
      most = hit->distance;
    }
    return any && nearest;
  };
  const auto enters = [&](const Node& node) {
    float enter = 0, leave = most;
    for (int k = 0; k < 3; ++k) {
      const float a = node.low[k] * inverse[k] - start[k], b = node.high[k] * inverse[k] - start[k];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave ? enter : kFar;
  };
  if (meet(0, num_large_)) return nearest;
  std::array<std::pair<int, float>, 64> stack;
  int size = 0;
  if (const float enter = enters(nodes_[0]); enter < kFar) stack[size++] = {0, enter};
  while (size > 0) {
    const auto [index, distance] = stack[--size];
    if (distance > most) continue;
    const Node& node = nodes_[index];
    if (node.count > 0) {
      if (meet(node.first, node.count)) return nearest;
      continue;
    }
    const int left = index + 1, right = node.first;
    const float to_left = enters(nodes_[left]), to_right = enters(nodes_[right]);
    const bool left_first = to_left < to_right;  // the nearer one is taken first, so pushed last
    const std::pair<int, float> near = {left_first ? left : right, std::min(to_left, to_right)};
    const std::pair<int, float> far = {left_first ? right : left, std::max(to_left, to_right)};
    if (far.second < kFar) stack[size++] = far;
    if (near.second < kFar) stack[size++] = near;
  }
  return nearest;
}

std::optional<LargeHit> LargeScene::Trace(const Vector3f& origin, const Vector3f& direction) const {
  return Walk(origin, direction, kFar, false);
}

Vector3f LargeScene::SkyColor(const Vector3f& direction) const {
  const Vector3f d = direction.normalized();
  const float up = std::max(0.0f, -d.y());
  const Vector3f blue = Vector3f(0.75f, 0.8f, 0.85f) * (1 - up) + Vector3f(0.25f, 0.45f, 0.8f) * up;
  const float cloud = std::max(0.0f, Fractal(d * 3, 1, 0.02f) - 0.45f);
  return blue + (Vector3f::Constant(0.95f) - blue) * std::min(1.0f, 2.5f * cloud);
}

// A share of the two colours by noise; on bricks, joints have the second colour.
Vector3f LargeScene::PatternColor(const Material& material, const Vector3f& at,
                                  float footprint) const {
  const float share = Fractal(at, material.size, footprint);
  if (!material.bricks) {
    return material.color + share * (material.other - material.color);
  }
  const float row = at.y() / material.size, along = (at.x() + at.z()) / (2.4f * material.size);
  const float shifted = along + 0.5f * std::fmod(std::floor(row), 2.0f);
  const float in_row = row - std::floor(row), in_brick = shifted - std::floor(shifted);
  if (in_row < 0.12f || in_brick < 0.06f) return material.other * (0.8f + 0.4f * share);
  const float tone = Hash(static_cast<int>(std::floor(row)), static_cast<int>(std::floor(shifted)), 7);
  return material.color * (0.6f + 0.4f * tone + 0.4f * share);
}

Vector3f LargeScene::Color(const Vector3f& origin, const Vector3f& direction, float spread) const {
  const auto hit = Trace(origin, direction);
  if (!hit) return SkyColor(direction);
  const Vector3f at = origin + hit->distance * direction, normal = hit->normal;
  const Material& material = materials_[hit->piece->material];
  const float footprint = hit->distance * spread;
  const Vector3f off = at + (kOff + 1e-5f * hit->distance) * normal;
  float light = std::max(0.0f, normal.dot(to_lamp_));
  const bool open = place_ == Place::kYard;  // indoors the lamp has no wall before it
  if (light > 0 && Walk(off, to_lamp_, open ? kFar : 2.5f, true)) light = 0;
  const float sky = 0.7f - 0.3f * normal.y();
  Vector3f color = PatternColor(material, at, footprint) * (kAmbient * sky + light);
  if (material.gloss > 0) {
    const Vector3f view = direction.normalized();
    const Vector3f mirrored = view - 2 * normal.dot(view) * normal;
    const float grazing = std::pow(1 + std::min(0.0f, normal.dot(view)), 5.0f);
    const float share = material.gloss + (1 - material.gloss) * grazing * 0.5f;
    const float lamp = light > 0 ? std::pow(std::max(0.0f, mirrored.dot(to_lamp_)), 60.0f) : 0;
    const Vector3f seen = open ? SkyColor(mirrored) : Vector3f::Constant(0.35f + 0.2f * -mirrored.y());
    color += share * (0.5f * (seen - color) + Vector3f::Constant(2 * lamp));
  }
  return color;
}

}  // namespace pepeseg
