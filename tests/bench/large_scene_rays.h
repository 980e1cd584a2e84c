#pragma once

#include <cstdint>

#include "kernels/math/vec.h"

// Rays through a place of large_scene.h, on the host and in CUDA. World: x right, y down,
// metres; the ground is at y = 0. Colours are linear, [0, 1].

namespace pepeseg {

using Float3 = Vec3<float>;

// Pattern of two colours on a surface.
struct Material {
  Float3 color, other;
  float size = 0.1f;    // of the largest spots of the pattern, or of a course of bricks, metres
  bool bricks = false;  // bricks with joints in place of spots
  float gloss = 0;      // share of the light that is mirrored straight on
};

// A box or an ellipsoid: where the largest coordinate, or the length, of to_unit (p - center) is at
// most 1.
struct Piece {
  Mat3<float> to_unit;
  Float3 center;
  bool is_box = false;
  uint16_t material = 0;
  uint16_t thing = 0;  // label from 1 on; 0: surroundings
};

// A box of the hierarchy. A leaf has `count` pieces from `first` on; else count is 0 and its
// children are the node after it and the node `first`.
struct PieceNode {
  float low[3], high[3];
  int first, count;
};

// A place, in memory of the host or of a device.
struct SceneSpans {
  const Piece* pieces;  // large ones first, which no node has
  int num_large;
  const PieceNode* nodes;
  const Material* materials;
  bool has_sky;
  Float3 to_lamp;       // of length 1
  uint16_t unseen = 0;  // thing that casts its shadow but is not seen; 0: none
};

struct RayHit {
  float distance;      // in lengths of the direction
  const Piece* piece;  // null: nothing was hit
  Float3 normal;       // of length 1, towards the ray's origin
};

inline constexpr float kFar = 1e9f;

PEPESEG_HD float Clamp01(float x) { return Min(Max(x, 0.0f), 1.0f); }
PEPESEG_HD float Floor(float x) { return ::floorf(x); }
PEPESEG_HD float At(Float3 v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

PEPESEG_HD float HashNoise(int x, int y, int z) {
  uint32_t h = static_cast<uint32_t>(x) * 0x8da6b343u ^ static_cast<uint32_t>(y) * 0xd8163841u ^
               static_cast<uint32_t>(z) * 0xcb1ab31fu;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h ^= h >> 13;
  return static_cast<float>(h & 0xffffffu) / static_cast<float>(0xffffff);
}

// Noise in [0, 1] with spots of size 1.
PEPESEG_HD float SmoothNoise(Float3 p) {
  const Float3 base = {Floor(p.x), Floor(p.y), Floor(p.z)};
  const int x = static_cast<int>(base.x), y = static_cast<int>(base.y),
            z = static_cast<int>(base.z);
  const auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  const float sx = smooth(p.x - base.x), sy = smooth(p.y - base.y), sz = smooth(p.z - base.z);
  const auto edge = [&](int j, int k) {
    const float a = HashNoise(x, y + j, z + k), b = HashNoise(x + 1, y + j, z + k);
    return a + sx * (b - a);
  };
  const auto face = [&](int k) {
    const float a = edge(0, k), b = edge(1, k);
    return a + sy * (b - a);
  };
  const float a = face(0), b = face(1);
  return a + sz * (b - a);
}

// Sum of noise from `size` down to the footprint of a pixel, in [0, 1].
PEPESEG_HD float FractalNoise(Float3 p, float size, float footprint) {
  float sum = 0.5f, weight = 0.5f, shift = 0;
  for (int octave = 0; octave < 8 && size > footprint; ++octave) {
    sum += weight * (SmoothNoise((1 / size) * p + Float3{shift, shift, shift}) - 0.5f);
    size *= 0.5f, weight *= 0.8f, shift += 17.3f;
  }
  return Clamp01(sum);
}

// Takes the hit of a piece into `nearest` where it is nearer.
PEPESEG_HD void MeetPiece(const Piece& piece, Float3 origin, Float3 direction, RayHit& nearest) {
  const Float3 o = piece.to_unit * (origin - piece.center), d = piece.to_unit * direction;
  if (piece.is_box) {
    float enter = -kFar, leave = kFar;
    int axis = 0;
    for (int k = 0; k < 3; ++k) {
      const float inverse = 1 / At(d, k);
      const float a = (-1 - At(o, k)) * inverse, b = (1 - At(o, k)) * inverse;
      if (Min(a, b) > enter) enter = Min(a, b), axis = k;
      leave = Min(leave, Max(a, b));
    }
    if (enter <= 0 || enter > leave || enter >= nearest.distance) return;
    const Float3 row = axis == 0   ? piece.to_unit.row0
                       : axis == 1 ? piece.to_unit.row1
                                   : piece.to_unit.row2;
    nearest = {enter, &piece, Normalize((At(d, axis) > 0 ? -1.0f : 1.0f) * row)};
    return;
  }
  const float a = Dot(d, d), b = Dot(o, d), c = Dot(o, o) - 1;
  const float root = b * b - a * c;
  if (root < 0 || c < 0) return;
  const float distance = (-b - Sqrt(root)) / a;
  if (distance <= 0 || distance >= nearest.distance) return;
  nearest = {distance, &piece, Normalize(MulTransposed(piece.to_unit, o + distance * d))};
}

// Returns where the ray enters the node's box, kFar where it does not before `most`.
PEPESEG_HD float EnterNode(const PieceNode& node, Float3 start, Float3 inverse, float most) {
  float enter = 0, leave = most;
  for (int k = 0; k < 3; ++k) {
    const float a = node.low[k] * At(inverse, k) - At(start, k);
    const float b = node.high[k] * At(inverse, k) - At(start, k);
    enter = Max(enter, Min(a, b));
    leave = Min(leave, Max(a, b));
  }
  return enter <= leave ? enter : kFar;
}

// Returns the nearest hit before `most`; with `any`, for shadows, the first one that is found.
PEPESEG_HD RayHit TraceRay(const SceneSpans& scene, Float3 origin, Float3 direction, float most,
                           bool any) {
  RayHit nearest = {most, nullptr, {0, 0, 0}};
  const auto meet = [&](const Piece& piece) {
    if (any || scene.unseen == 0 || piece.thing != scene.unseen) {
      MeetPiece(piece, origin, direction, nearest);
    }
  };
  for (int i = 0; i < scene.num_large; ++i) meet(scene.pieces[i]);
  const Float3 inverse = {1 / direction.x, 1 / direction.y, 1 / direction.z};
  const Float3 start = Scale(origin, inverse);
  constexpr int kDeepest = 48;  // the median splits halve the pieces at each level
  int stack[kDeepest];
  float entered[kDeepest];
  int size = 1;
  stack[0] = 0;
  entered[0] = EnterNode(scene.nodes[0], start, inverse, most);
  while (size > 0 && !(any && nearest.piece != nullptr)) {
    --size;
    if (entered[size] >= nearest.distance) continue;
    const int index = stack[size];
    const PieceNode& node = scene.nodes[index];
    for (int i = node.first; i < node.first + node.count; ++i) meet(scene.pieces[i]);
    if (node.count > 0) continue;
    const int left = index + 1, right = node.first;
    const float to_left = EnterNode(scene.nodes[left], start, inverse, nearest.distance);
    const float to_right = EnterNode(scene.nodes[right], start, inverse, nearest.distance);
    const bool left_first = to_left < to_right;  // the nearer one is pushed last and taken first
    stack[size] = left_first ? right : left;
    entered[size++] = Max(to_left, to_right);
    stack[size] = left_first ? left : right;
    entered[size++] = Min(to_left, to_right);
  }
  return nearest;
}

PEPESEG_HD Float3 SkyColor(Float3 direction) {
  const Float3 d = Normalize(direction);
  const float up = Max(0.0f, -d.y);
  const Float3 blue = (1 - up) * Float3{0.75f, 0.8f, 0.85f} + up * Float3{0.25f, 0.45f, 0.8f};
  const float cloud = Max(0.0f, FractalNoise(3.0f * d, 1, 0.02f) - 0.45f);
  return blue + Min(1.0f, 2.5f * cloud) * (Float3{0.95f, 0.95f, 0.95f} - blue);
}

// A share of the two colours by noise; on bricks, joints have the second colour.
PEPESEG_HD Float3 PatternColor(const Material& material, Float3 at, float footprint) {
  const float share = FractalNoise(at, material.size, footprint);
  if (!material.bricks) return material.color + share * (material.other - material.color);
  const float row = at.y / material.size, along = (at.x + at.z) / (2.4f * material.size);
  const float course = Floor(row), shifted = along + 0.5f * (course - 2 * Floor(0.5f * course));
  if (row - course < 0.12f || shifted - Floor(shifted) < 0.06f) {
    return (0.8f + 0.4f * share) * material.other;
  }
  const float tone = HashNoise(static_cast<int>(course), static_cast<int>(Floor(shifted)), 7);
  return (0.6f + 0.4f * tone + 0.4f * share) * material.color;
}

// Returns the colour that a ray sees. `spread`: width of a pixel at distance 1.
PEPESEG_HD Float3 RayColor(const SceneSpans& scene, Float3 origin, Float3 direction, float spread) {
  constexpr float kOff = 1e-3f;  // rays from a surface begin this far from it, metres
  constexpr float kAmbient = 0.45f;
  constexpr float kLampDistance = 2.5f;  // indoors no wall is before the lamp
  const RayHit hit = TraceRay(scene, origin, direction, kFar, false);
  if (hit.piece == nullptr) return SkyColor(direction);
  const Float3 at = origin + hit.distance * direction;
  const Float3 off = at + (kOff + 1e-5f * hit.distance) * hit.normal;
  const Material& material = scene.materials[hit.piece->material];
  float light = Max(0.0f, Dot(hit.normal, scene.to_lamp));
  if (light > 0) {
    const float most = scene.has_sky ? kFar : kLampDistance;
    if (TraceRay(scene, off, scene.to_lamp, most, true).piece != nullptr) light = 0;
  }
  Float3 color = (kAmbient * (0.7f - 0.3f * hit.normal.y) + light) *
                 PatternColor(material, at, hit.distance * spread);
  if (material.gloss > 0) {
    const Float3 view = Normalize(direction);
    const float facing = Dot(hit.normal, view);
    const Float3 mirrored = view - (2 * facing) * hit.normal;
    const float rim = 1 + Min(0.0f, facing);
    const float share = material.gloss + (1 - material.gloss) * 0.5f * rim * rim * rim * rim * rim;
    const float toward = Max(0.0f, Dot(mirrored, scene.to_lamp));
    const float lamp = light > 0 ? Exp(60 * Log(toward + 1e-9f)) : 0.0f;
    const float room = 0.35f - 0.2f * mirrored.y;
    const Float3 seen = scene.has_sky ? SkyColor(mirrored) : Float3{room, room, room};
    color = color + share * (0.5f * (seen - color) + Float3{2 * lamp, 2 * lamp, 2 * lamp});
  }
  return color;
}

// A pinhole camera.
struct SceneCamera {
  Float3 center;
  Mat3<float> cam_from_world;  // rotation
  int width, height;
  float focal;  // pixels; the principal point is the middle of the picture

  // The direction through a point of the picture, 1 long along the camera's axis.
  PEPESEG_HD Float3 Direction(float x, float y) const {
    const float u = (x - 0.5f * static_cast<float>(width)) / focal;
    const float v = (y - 0.5f * static_cast<float>(height)) / focal;
    return MulTransposed(cam_from_world, Float3{u, v, 1});
  }
};

PEPESEG_HD uint8_t EncodedColor(float linear) {
  return static_cast<uint8_t>(255 * Exp(Log(Clamp01(linear) + 1e-9f) / 2.2f) + 0.5f);
}

// Writes the colour (blue, green, red) of a pixel, of four rays, and the label at its centre.
PEPESEG_HD void PhotographPixel(const SceneSpans& scene, const SceneCamera& camera, int x, int y,
                                uint8_t* bgr, uint16_t* label) {
  const float spread = 1 / camera.focal;
  const auto left = static_cast<float>(x), top = static_cast<float>(y);
  Float3 sum = {0, 0, 0};
  for (int k = 0; k < 4; ++k) {
    const Float3 direction =
        camera.Direction(left + (k % 2 == 0 ? 0.25f : 0.75f), top + (k < 2 ? 0.25f : 0.75f));
    const Float3 color = RayColor(scene, camera.center, direction, spread);
    sum = sum + Float3{Clamp01(color.x), Clamp01(color.y), Clamp01(color.z)};
  }
  bgr[0] = EncodedColor(sum.z / 4), bgr[1] = EncodedColor(sum.y / 4);
  bgr[2] = EncodedColor(sum.x / 4);
  const Float3 middle = camera.Direction(left + 0.5f, top + 0.5f);
  const RayHit hit = TraceRay(scene, camera.center, middle, kFar, false);
  *label = hit.piece == nullptr ? uint16_t{0} : hit.piece->thing;
}

}  // namespace pepeseg
