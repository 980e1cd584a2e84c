#include "tests/bench/room_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace pepeseg {
namespace {

using Vector = std::array<float, 3>;
constexpr float kHalfRoom = 2.5f, kHalfHeight = 1.3f;  // metres; y is down

struct SurfacePoint {
  Vector at, normal;
  float surface_area;  // total, which gives the distance between neighbours
};

class Room {
 public:
  explicit Room(uint64_t seed) : engine_(seed) {
    for (int i = 0; i < 24; ++i) {
      const float size = Uniform(0.1f, 0.45f);
      objects_.push_back({{Uniform(-1.3f, 1.3f), kHalfHeight - size, Uniform(-1.3f, 1.3f)}, size});
    }
  }

  // 40 % on the walls, 60 % on the objects, which is where photographs look.
  SurfacePoint Draw() { return Uniform(0, 1) < 0.4f ? OnWall() : OnObject(); }
  float Uniform(float low, float high) {
    return std::uniform_real_distribution<float>(low, high)(engine_);
  }
  float Normal() { return std::normal_distribution<float>()(engine_); }

 private:
  struct Object {
    Vector center;
    float size;  // radius, or half the edge
  };

  SurfacePoint OnBox(const Vector& half) {
    const int axis = static_cast<int>(engine_() % 3);
    const float side = engine_() % 2 ? 1.0f : -1.0f;
    SurfacePoint out = {};
    for (int k = 0; k < 3; ++k) out.at[k] = k == axis ? side * half[k] : Uniform(-half[k], half[k]);
    out.normal[axis] = side;
    return out;
  }
  SurfacePoint OnWall() {
    SurfacePoint out = OnBox({kHalfRoom, kHalfHeight, kHalfRoom});
    out.surface_area = 8 * kHalfRoom * (kHalfRoom + 2 * kHalfHeight) / 0.4f;
    return out;
  }
  SurfacePoint OnObject() {
    const Object& object = objects_[engine_() % objects_.size()];
    SurfacePoint out;
    if (object.size < 0.25f) {
      out.at = out.normal = OnSphere();
      for (float& x : out.at) x *= object.size;
    } else {
      out = OnBox({object.size, object.size, object.size});
    }
    for (int k = 0; k < 3; ++k) out.at[k] += object.center[k];
    out.surface_area = 24 * object.size * object.size * static_cast<float>(objects_.size()) / 0.6f;
    return out;
  }
  Vector OnSphere() {
    const Vector v = {Normal(), Normal(), Normal()};
    const float norm = std::hypot(v[0], v[1], v[2]);
    return {v[0] / norm, v[1] / norm, v[2] / norm};
  }

  std::mt19937_64 engine_;
  std::vector<Object> objects_;
};

}  // namespace

RoomScene MakeRoomScene(int64_t count, uint64_t seed) {
  RoomScene scene{count, std::vector<float>(count * NumPlanes(kMaxShDegree))};
  Room room(seed);
  const auto set = [&](int plane, int64_t i, float value) {
    scene.planes[plane * count + i] = value;
  };
  for (int64_t i = 0; i < count; ++i) {
    const SurfacePoint point = room.Draw();
    const float spacing = std::sqrt(point.surface_area / static_cast<float>(count));
    for (int k = 0; k < 3; ++k)
      set(kMeanPlane + k, i, point.at[k] + 0.05f * spacing * room.Normal());
    // Two long axes in the surface, the third across it.
    set(kLogScalePlane, i, std::log(spacing * std::exp(0.5f * room.Normal())));
    set(kLogScalePlane + 1, i, std::log(spacing * std::exp(0.5f * room.Normal())));
    set(kLogScalePlane + 2, i, std::log(0.15f * spacing));
    // The shortest rotation from z to the normal, then a random rotation in the surface.
    const Vector& n = point.normal;
    const float w = std::max(1 + n[2], 1e-3f), turn = room.Uniform(0, std::numbers::pi_v<float>);
    const float c = std::cos(turn), s = std::sin(turn);
    set(kRotationPlane, i, w * c);
    set(kRotationPlane + 1, i, -n[1] * c + n[0] * s);
    set(kRotationPlane + 2, i, n[0] * c + n[1] * s);
    set(kRotationPlane + 3, i, w * s);
    // A third faint, the rest opaque, as in trained scenes.
    set(kOpacityPlane, i,
        room.Uniform(0, 1) < 0.35f ? room.Uniform(-4, -0.5f) : room.Uniform(0, 4));
    for (int k = 0; k < 48; ++k) set(kShPlane + k, i, room.Normal() * (k < 3 ? 0.6f : 0.06f));
  }
  return scene;
}

PinholeView RoomView(int index, int count, int width, int height) {
  const float angle =
      2 * std::numbers::pi_v<float> * static_cast<float>(index) / static_cast<float>(count);
  const float c = std::cos(angle), s = std::sin(angle);
  PinholeView view;
  view.width = width;
  view.height = height;
  view.fx = view.fy = 0.75f * static_cast<float>(width);
  view.cx = 0.5f * static_cast<float>(width);
  view.cy = 0.5f * static_cast<float>(height);
  // The camera is at (-2 s, -0.3, -2 c) and looks at the middle, a little downwards.
  const float tilt = 0.25f, ct = std::cos(tilt), st = std::sin(tilt);
  const float rotation[3][3] = {{c, 0, -s}, {-st * s, ct, -st * c}, {ct * s, st, ct * c}};
  const float center[3] = {-2 * s, -0.3f, -2 * c};
  for (int r = 0; r < 3; ++r) {
    float* row = view.cam_from_world + 4 * r;
    for (int k = 0; k < 3; ++k) {
      row[k] = rotation[r][k];
      row[3] -= rotation[r][k] * center[k];
    }
  }
  return view;
}

}  // namespace pepeseg
