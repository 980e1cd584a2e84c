#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "tests/bench/large_scene.h"

namespace pepeseg {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;

class PlaceMaker {
 public:
  explicit PlaceMaker(uint64_t seed) : random_(seed) {}

  PlacePieces Yard() {
    Solid(Vector3f(0, 40, 0), Vector3f(400, 40, 400),
          Add({Rgb(0.55, 0.48, 0.4), Rgb(0.12, 0.11, 0.09), 0.4f}));
    for (int i = 0; i < 14; ++i) Hill(2 * kPi * static_cast<float>(i) / 14);
    for (int i = 0; i < 3; ++i) BrickWall(i);
    for (int i = 0; i < 16; ++i) Bush();
    for (int i = 0; i < 2500; ++i) Stone();
    for (int i = 0; i < 9000; ++i) GrassBlade();
    for (int i = 0; i < 30; ++i) Crate(Disc(3.5f), 0);
    return std::move(out_);
  }

  PlacePieces Workshop() {
    Room();
    for (int i = 0; i < 10; ++i) Shelf(2 * kPi * static_cast<float>(i) / 10);
    Bench();
    for (int i = 0; i < 120; ++i)
      SmallThing({Uniform(-1.4f, 1.4f), kBenchTop, Uniform(-0.7f, 0.7f)});
    for (int i = 0; i < 400; ++i) SmallThing(Disc(4.5f));
    return std::move(out_);
  }

  PlacePieces Table() {
    Room();
    Bench();
    for (int column = -2; column <= 2; ++column) {
      for (int row = -1; row <= 1; ++row) {
        const Vector3f at(0.55f * static_cast<float>(column) + Uniform(-0.08f, 0.08f), kBenchTop,
                          0.44f * static_cast<float>(row) + Uniform(-0.05f, 0.05f));
        LooseThing(at);
      }
    }
    return std::move(out_);
  }

 private:
  static constexpr float kBenchTop = -0.89f;

  void Room() {
    const int floor = Add({Rgb(0.45, 0.33, 0.22), Rgb(0.25, 0.17, 0.1), 0.3f, false, 0.15f});
    const int wall = Add({Rgb(0.7, 0.68, 0.6), Rgb(0.45, 0.45, 0.42), 0.5f});
    Solid(Vector3f(0, 0.1f, 0), Vector3f(7, 0.1f, 7), floor);
    Solid(Vector3f(0, -4.1f, 0), Vector3f(7, 0.1f, 7), wall);
    const int bricks = Add({Rgb(0.6, 0.35, 0.25), Rgb(0.7, 0.68, 0.62), 0.08f, true});
    for (const float side : {-1.0f, 1.0f}) {
      Solid(Vector3f(7 * side, -2, 0), Vector3f(0.1f, 2.2f, 7), side < 0 ? wall : bricks);
      Solid(Vector3f(0, -2, 7 * side), Vector3f(7, 2.2f, 0.1f), side < 0 ? bricks : wall);
    }
  }
  float Uniform(float low, float high) {
    const auto share = static_cast<float>(static_cast<double>(random_() >> 11) * 0x1p-53);
    return low + (high - low) * share;
  }
  Float3 Rgb(double r, double g, double b) {
    return Uniform(0.85f, 1.1f) *
           Float3{static_cast<float>(r), static_cast<float>(g), static_cast<float>(b)};
  }
  Float3 AnyColor() { return {Uniform(0.08f, 0.8f), Uniform(0.08f, 0.8f), Uniform(0.08f, 0.8f)}; }
  // A point of the ground around the middle.
  Vector3f Disc(float radius) {
    const float angle = Uniform(0, 2 * kPi), r = radius * std::sqrt(Uniform(0, 1));
    return {r * std::cos(angle), 0, r * std::sin(angle)};
  }
  Matrix3f AnyTurn() {
    const Vector3f axis =
        Vector3f(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1) + 1e-3f).normalized();
    return Eigen::AngleAxisf(Uniform(0, kPi), axis).toRotationMatrix();
  }
  static Matrix3f About(float angle) {
    return Eigen::AngleAxisf(angle, Vector3f::UnitY()).toRotationMatrix();
  }

  int Add(Material material) {
    out_.materials.push_back(material);
    return static_cast<int>(out_.materials.size()) - 1;
  }
  void Put(const Vector3f& center, const Vector3f& half, const Matrix3f& turn, bool is_box,
           int material, int thing) {
    const Matrix3f to_unit = half.cwiseInverse().asDiagonal() * turn.transpose();
    const auto row = [&](int k) { return Float3{to_unit(k, 0), to_unit(k, 1), to_unit(k, 2)}; };
    Piece piece;
    piece.to_unit = {row(0), row(1), row(2)};
    piece.center = {center.x(), center.y(), center.z()};
    piece.is_box = is_box;
    piece.material = static_cast<uint16_t>(material);
    piece.thing = static_cast<uint16_t>(thing);
    out_.pieces.push_back(piece);
  }
  void Solid(const Vector3f& center, const Vector3f& half, int material) {
    Put(center, half, Matrix3f::Identity(), true, material, 0);
  }

  void Hill(float angle) {
    const float distance = Uniform(60, 110);
    const Vector3f center(distance * std::cos(angle), 2, distance * std::sin(angle));
    Put(center, {Uniform(25, 45), Uniform(8, 20), Uniform(25, 45)}, About(Uniform(0, kPi)), false,
        Add({Rgb(0.25, 0.35, 0.16), Rgb(0.12, 0.18, 0.1), 6}), 0);
  }
  void BrickWall(int index) {
    const float angle = 2.1f * static_cast<float>(index) + Uniform(-0.3f, 0.3f);
    const float distance = Uniform(11, 14), height = Uniform(1.2f, 2.2f);
    const Vector3f center(distance * std::cos(angle), -height, distance * std::sin(angle));
    const Matrix3f turn = About(-angle);
    const int thing = ++out_.num_things;
    Put(center, {0.2f, height, Uniform(4, 7)}, turn, true,
        Add({Rgb(0.6, 0.3, 0.2), Rgb(0.7, 0.66, 0.6), 0.09f, true}), thing);
    for (int i = -2; i <= 2; ++i) {  // windows
      const Vector3f offset(-0.2f, 0, 1.6f * static_cast<float>(i));
      Put(center + turn * offset, {0.03f, 0.5f * height, 0.45f}, turn, true,
          Add({Rgb(0.08, 0.1, 0.13), Rgb(0.05, 0.06, 0.08), 0.5f, false, 0.5f}), thing);
    }
  }
  void Bush() {
    const Vector3f foot = Disc(6);
    const float size = Uniform(0.4f, 1);
    const int thing = ++out_.num_things;
    const int leaves = Add({Rgb(0.25, 0.45, 0.12), Rgb(0.12, 0.28, 0.06), 0.02f, false, 0.06f});
    const int dry = Add({Rgb(0.5, 0.42, 0.15), Rgb(0.3, 0.2, 0.08), 0.02f});
    const auto count = static_cast<int>(1200 * size);
    for (int i = 0; i < count; ++i) {
      Vector3f at(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1));
      at = at.normalized() * size * std::pow(Uniform(0.2f, 1), 0.4f);
      const float leaf = Uniform(0.03f, 0.07f);
      Put(foot + at - Vector3f(0, 0.9f * size, 0), {leaf, 0.08f * leaf, 0.5f * leaf}, AnyTurn(),
          false, Uniform(0, 1) < 0.85f ? leaves : dry, thing);
    }
  }
  void Stone() {
    const Vector3f at = Disc(8);
    const float size = 0.015f + 0.06f * std::pow(Uniform(0, 1), 3.0f);
    Put(at, {size, 0.6f * size, 0.8f * size}, AnyTurn(), false, StoneMaterial(), 0);
  }
  int StoneMaterial() {
    if (stones_.size() < 8) {
      const float grey = Uniform(0.2f, 0.7f);
      stones_.push_back(Add({Rgb(grey, 0.97 * grey, 0.9 * grey), Rgb(0.3, 0.28, 0.25), 0.03f}));
    }
    return stones_[random_() % stones_.size()];
  }
  void GrassBlade() {
    if (grass_.empty()) {
      for (int i = 0; i < 4; ++i) {
        grass_.push_back(Add({Rgb(0.3, 0.45, 0.15), Rgb(0.45, 0.42, 0.2), 0.05f}));
        patches_.push_back(Disc(6));
        patches_.push_back(Disc(7));
      }
    }
    const Vector3f at = patches_[random_() % patches_.size()] + Disc(1.1f);
    const float length = Uniform(0.04f, 0.14f);
    const Matrix3f lean =
        About(Uniform(0, kPi)) * Eigen::AngleAxisf(Uniform(-0.6f, 0.6f), Vector3f::UnitX());
    Put(at - Vector3f(0, 0.8f * length, 0), {0.004f, length, 0.0015f}, lean, false,
        grass_[random_() % grass_.size()], 0);
  }
  void Crate(Vector3f at, float ground) {
    const int thing = ++out_.num_things;
    const Vector3f half(Uniform(0.08f, 0.35f), Uniform(0.08f, 0.3f), Uniform(0.08f, 0.35f));
    at.y() = ground - half.y();
    Put(at, half, About(Uniform(0, kPi)), Uniform(0, 1) < 0.7f,
        Add({AnyColor(), AnyColor(), Uniform(0.02f, 0.1f), false, Uniform(0, 0.3f)}), thing);
  }
  void SmallThing(Vector3f at) {
    const int thing = ++out_.num_things;
    const float size = Uniform(0.02f, 0.15f);
    const Vector3f half(size, size * Uniform(0.4f, 2), size * Uniform(0.5f, 1.5f));
    at.y() -= half.y();
    const bool is_box = Uniform(0, 1) < 0.6f;
    const int material = Add(
        {AnyColor(), AnyColor(), Uniform(0.01f, 0.06f), Uniform(0, 1) < 0.1f, Uniform(0, 0.4f)});
    const Matrix3f turn = About(Uniform(0, kPi));
    Put(at, half, turn, is_box, material, thing);
    if (!is_box) return;
    const Vector3f front(0, 0, -1.02f * half.z());  // a label
    Put(at + turn * front, {0.7f * half.x(), 0.4f * half.y(), 0.03f * half.z()}, turn, true,
        Add({AnyColor(), AnyColor(), 0.015f}), thing);
  }
  void Shelf(float angle) {
    const int wood = Add({Rgb(0.5, 0.38, 0.22), Rgb(0.32, 0.22, 0.12), 0.06f});
    const int thing = ++out_.num_things;
    const Matrix3f turn = About(-angle);
    const Vector3f middle(5.6f * std::cos(angle), 0, 5.6f * std::sin(angle));
    for (int level = 0; level < 5; ++level) {
      const Vector3f board = middle - Vector3f(0, 0.3f + 0.55f * static_cast<float>(level), 0);
      Put(board, {0.25f, 0.02f, 1.2f}, turn, true, wood, thing);
      for (int i = 0; i < 14; ++i) {
        const Vector3f offset(Uniform(-0.15f, 0.15f), -0.02f, Uniform(-1.1f, 1.1f));
        SmallThing(board + turn * offset);
      }
    }
  }
  void Bench() {
    const int wood = Add({Rgb(0.55, 0.42, 0.25), Rgb(0.35, 0.24, 0.13), 0.08f, false, 0.1f});
    const int thing = ++out_.num_things;
    Put({0, -0.85f, 0}, {1.5f, 0.04f, 0.8f}, Matrix3f::Identity(), true, wood, thing);
    for (const float x : {-1.4f, 1.4f}) {
      for (const float z : {-0.7f, 0.7f}) {
        Put({x, -0.42f, z}, {0.05f, 0.42f, 0.05f}, Matrix3f::Identity(), true, wood, thing);
      }
    }
  }
  // One that touches no other.
  void LooseThing(const Vector3f& foot) {
    const int thing = ++out_.num_things;
    const Vector3f half(Uniform(0.06f, 0.13f), Uniform(0.05f, 0.2f), Uniform(0.06f, 0.13f));
    Put(foot - Vector3f(0, half.y(), 0), half, About(Uniform(0, kPi)), Uniform(0, 1) < 0.5f,
        Add({AnyColor(), AnyColor(), Uniform(0.02f, 0.08f), false, Uniform(0, 0.2f)}), thing);
  }

  std::mt19937_64 random_;
  PlacePieces out_;
  std::vector<int> stones_, grass_;
  std::vector<Vector3f> patches_;
};

}  // namespace

PlacePieces MakePlace(Place place, uint64_t seed) {
  PlaceMaker maker(seed);
  switch (place) {
    case Place::kYard:
      return maker.Yard();
    case Place::kWorkshop:
      return maker.Workshop();
    case Place::kTable:
      break;
  }
  return maker.Table();
}

}  // namespace pepeseg
