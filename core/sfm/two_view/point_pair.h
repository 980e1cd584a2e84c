#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace pepeseg {

// Two matched points, one of each photograph. Pixels, or coordinates on the plane z = 1 of the
// camera where a function says "normalised".
struct PointPair {
  Eigen::Vector2d first = Eigen::Vector2d::Zero(), second = Eigen::Vector2d::Zero();
};

// Random numbers that depend on the seed only (splitmix64, Steele et al. 2014).
class SeededDraws {
 public:
  explicit SeededDraws(uint64_t seed) : state_(seed) {}

  uint64_t Next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  // Returns a number in [0, count). The bias is below count / 2^32.
  uint32_t Below(uint32_t count) {
    return static_cast<uint32_t>(((Next() >> 32) * uint64_t{count}) >> 32);
  }
  // Returns a number in [0, 1).
  double Unit() { return static_cast<double>(Next() >> 11) * 0x1p-53; }

 private:
  uint64_t state_;
};

}  // namespace pepeseg
