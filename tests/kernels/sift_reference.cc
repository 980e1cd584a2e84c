#include "tests/kernels/sift_reference.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace pepeseg {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

struct Plane {
  int width, height;
  std::vector<double> values;

  double At(int x, int y) const {
    return values[static_cast<size_t>(std::clamp(y, 0, height - 1)) * width +
                  std::clamp(x, 0, width - 1)];
  }
};

template <class Function>
Plane MakePlane(int width, int height, Function value) {
  Plane plane = {width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) plane.values.push_back(value(x, y));
  }
  return plane;
}

Plane Blurred(const Plane& in, double sigma) {
  const int radius = static_cast<int>(std::ceil(4 * sigma));
  std::vector<double> taps;
  for (int k = -radius; k <= radius; ++k) taps.push_back(std::exp(-0.5 * k * k / sigma / sigma));
  double sum = 0;
  for (const double tap : taps) sum += tap;
  const auto filter = [&](const Plane& plane, int dx, int dy) {
    return MakePlane(in.width, in.height, [&](int x, int y) {
      double value = 0;
      for (int k = -radius; k <= radius; ++k) {
        value += taps[k + radius] / sum * plane.At(x + k * dx, y + k * dy);
      }
      return value;
    });
  };
  return filter(filter(in, 1, 0), 0, 1);
}

double SigmaOf(double level) { return 1.6 * std::exp2(level / 3); }

// Levels 0 to 5 of an octave whose level 0 is given.
std::vector<Plane> LevelsFrom(Plane first) {
  std::vector<Plane> levels = {std::move(first)};
  for (int k = 1; k < 6; ++k) {
    const double before = SigmaOf(k - 1), after = SigmaOf(k);
    levels.push_back(Blurred(levels.back(), std::sqrt(after * after - before * before)));
  }
  return levels;
}

// An octave, and what is searched in it.
class Octave {
 public:
  Octave(Plane first, double step) : levels_(LevelsFrom(std::move(first))), step_(step) {}

  const Plane& Level(int level) const { return levels_[level]; }
  void AddFeatures(std::vector<ReferenceFeature>* features) const;

 private:
  double Dog(int x, int y, int level) const {
    return levels_[level + 1].At(x, y) - levels_[level].At(x, y);
  }
  bool IsExtremum(int x, int y, int level) const;
  bool Fit(int x, int y, int level, Eigen::Vector3d* point) const;
  struct Gradient {
    double magnitude, angle;
  };
  Gradient GradientAt(int x, int y, int level) const;
  std::vector<double> Angles(const Eigen::Vector2d& at, double sigma, int level) const;
  ReferenceFeature Describe(const Eigen::Vector2d& at, double sigma, int level, double angle) const;

  std::vector<Plane> levels_;
  double step_;
};

bool Octave::IsExtremum(int x, int y, int level) const {
  const double value = Dog(x, y, level);
  if (std::abs(value) < 0.8 * 0.02 / 3) return false;
  for (int k = 0; k < 27; ++k) {
    if (k == 13) continue;
    const double other = Dog(x + k % 3 - 1, y + k / 3 % 3 - 1, level + k / 9 - 1);
    if (value > 0 ? value <= other : value >= other) return false;
  }
  return true;
}

// Fits a quadratic, moves by whole pixels, and tests contrast and edge. `point` is x, y and level.
bool Octave::Fit(int x, int y, int level, Eigen::Vector3d* point) const {
  Eigen::Vector3d offset;
  Eigen::Matrix3d second;
  Eigen::Vector3d first;
  for (int step = 0;; ++step) {
    const auto at = [&](const Eigen::Vector3i& d) {
      return Dog(x + d.x(), y + d.y(), level + d.z());
    };
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3i a = Eigen::Vector3i::Unit(i);
      first[i] = (at(a) - at(-a)) / 2;
      for (int j = 0; j < 3; ++j) {
        const Eigen::Vector3i b = Eigen::Vector3i::Unit(j);
        second(i, j) = i == j ? at(a) + at(-a) - 2 * at({0, 0, 0})
                              : (at(a + b) + at(-a - b) - at(a - b) - at(b - a)) / 4;
      }
    }
    offset = -second.fullPivLu().solve(first);
    const int dx = offset.x() > 0.6 && x < levels_[0].width - 2 ? 1
                   : offset.x() < -0.6 && x > 1                 ? -1
                                                                : 0;
    const int dy = offset.y() > 0.6 && y < levels_[0].height - 2 ? 1
                   : offset.y() < -0.6 && y > 1                  ? -1
                                                                 : 0;
    if (step == 4 || (dx == 0 && dy == 0)) break;
    x += dx;
    y += dy;
  }
  *point = Eigen::Vector3d(x, y, level) + offset;
  const double value = Dog(x, y, level) + first.dot(offset) / 2;
  const Eigen::Matrix2d curvature = second.topLeftCorner<2, 2>();
  const double ratio = curvature.trace() * curvature.trace() / curvature.determinant();
  return std::abs(value) > 0.02 / 3 && ratio >= 0 && ratio < 12.1 &&
         offset.cwiseAbs().maxCoeff() < 1.5 && point->x() >= 0 && point->y() >= 0 &&
         point->x() <= levels_[0].width - 1 && point->y() <= levels_[0].height - 1;
}

// One-sided at the border: the clamped difference covers one pixel there, not two.
Octave::Gradient Octave::GradientAt(int x, int y, int level) const {
  const Plane& plane = levels_[level];
  const double over_x = x > 0 && x + 1 < plane.width ? 2 : 1;
  const double over_y = y > 0 && y + 1 < plane.height ? 2 : 1;
  const double gx = (plane.At(x + 1, y) - plane.At(x - 1, y)) / over_x;
  const double gy = (plane.At(x, y + 1) - plane.At(x, y - 1)) / over_y;
  return {std::hypot(gx, gy), std::atan2(gy, gx)};
}

std::vector<double> Octave::Angles(const Eigen::Vector2d& at, double sigma, int level) const {
  std::vector<double> bins(36);
  const double spread = 1.5 * sigma;
  const int radius = std::max(1, static_cast<int>(3 * spread));
  const int xi = static_cast<int>(at.x() + 0.5), yi = static_cast<int>(at.y() + 0.5);
  for (int y = std::max(0, yi - radius); y <= std::min(levels_[0].height - 1, yi + radius); ++y) {
    for (int x = std::max(0, xi - radius); x <= std::min(levels_[0].width - 1, xi + radius); ++x) {
      const double squared = (Eigen::Vector2d(x, y) - at).squaredNorm();
      if (squared >= radius * radius + 0.6) continue;
      const Gradient gradient = GradientAt(x, y, level);
      const double weight = gradient.magnitude * std::exp(-squared / (2 * spread * spread));
      const double bin = gradient.angle / kTurn * 36 - 0.5;
      const int lower = static_cast<int>(std::floor(bin));
      bins[(lower + 36) % 36] += weight * (lower + 1 - bin);
      bins[(lower + 37) % 36] += weight * (bin - lower);
    }
  }
  for (int pass = 0; pass < 6; ++pass) {
    const std::vector<double> before = bins;
    for (int k = 0; k < 36; ++k) {
      bins[k] = (before[(k + 35) % 36] + before[k] + before[(k + 1) % 36]) / 3;
    }
  }
  const double highest = *std::max_element(bins.begin(), bins.end());
  std::vector<double> angles;
  for (int k = 0; k < 36 && angles.size() < 2; ++k) {
    const double a = bins[(k + 35) % 36], b = bins[k], c = bins[(k + 1) % 36];
    if (b <= 0.8 * highest || b <= a || b <= c) continue;
    angles.push_back(kTurn / 36 * (k + 0.5 + 0.5 * (a - c) / (a + c - 2 * b)));
  }
  return angles;
}

ReferenceFeature Octave::Describe(const Eigen::Vector2d& at, double sigma, int level,
                                  double angle) const {
  ReferenceFeature feature = {at.x() * step_ + 0.5, at.y() * step_ + 0.5, sigma * step_, angle, {}};
  const Eigen::Matrix2d turn = Eigen::Rotation2Dd(-angle).toRotationMatrix() / (3 * sigma);
  for (int y = 1; y + 1 < levels_[0].height; ++y) {
    for (int x = 1; x + 1 < levels_[0].width; ++x) {
      const Eigen::Vector2d n = turn * (Eigen::Vector2d(x, y) - at);
      if (n.cwiseAbs().maxCoeff() >= 2.5) continue;
      const Gradient gradient = GradientAt(x, y, level);
      const double value = gradient.magnitude * std::exp(-n.squaredNorm() / 8);
      const double bin = (gradient.angle - angle) / kTurn * 8;
      // Every cell and direction within reach gets its share.
      for (int k = 0; k < kSiftDescriptorSize; ++k) {
        const double dx = std::abs(n.x() - (k / 8 % 4 - 1.5));
        const double dy = std::abs(n.y() - (k / 32 - 1.5));
        // COLMAP stores directions in the reverse order.
        const double db = std::abs(std::remainder(bin + k % 8, 8));
        feature.descriptor[k] +=
            value * std::max(0.0, 1 - dx) * std::max(0.0, 1 - dy) * std::max(0.0, 1 - db);
      }
    }
  }
  Eigen::Map<Eigen::VectorXd> d(feature.descriptor.data(), kSiftDescriptorSize);
  d = d.cwiseMin(0.2 * d.norm()).eval();
  d = (d / d.sum()).cwiseSqrt().eval() * 512;
  return feature;
}

void Octave::AddFeatures(std::vector<ReferenceFeature>* features) const {
  for (int level = 1; level <= 3; ++level) {
    for (int y = 1; y + 1 < levels_[0].height; ++y) {
      for (int x = 1; x + 1 < levels_[0].width; ++x) {
        Eigen::Vector3d point;
        if (!IsExtremum(x, y, level) || !Fit(x, y, level, &point)) continue;
        const double sigma = SigmaOf(point.z());
        for (const double angle : Angles(point.head<2>(), sigma, level)) {
          features->push_back(Describe(point.head<2>(), sigma, level, angle));
        }
      }
    }
  }
}

// Level 0 of octave -1 of a photograph with `margin` more pixels on each side.
Plane Finest(const Plane& photograph, int margin) {
  const int width = 2 * (photograph.width + 2 * margin);
  const int height = 2 * (photograph.height + 2 * margin);
  const Plane doubled = MakePlane(width, height, [&](int x, int y) {
    const int x0 = x / 2 - margin, x1 = (x + 1) / 2 - margin;
    const int y0 = y / 2 - margin, y1 = (y + 1) / 2 - margin;
    return (photograph.At(x0, y0) + photograph.At(x1, y0) + photograph.At(x0, y1) +
            photograph.At(x1, y1)) /
           4;
  });
  return Blurred(doubled, std::sqrt(1.6 * 1.6 - 1));
}

}  // namespace

std::vector<ReferenceFeature> ReferenceSift(const GreyImage& image) {
  std::vector<ReferenceFeature> features;
  if (std::min(image.width, image.height) < 3) return features;
  const Plane photograph = MakePlane(image.width, image.height, [&](int x, int y) {
    return image.pixels[static_cast<size_t>(y) * image.width + x] / 255.0;
  });
  Octave(Finest(photograph, 0), 0.5).AddFeatures(&features);
  // Octave 0 is made from octave -1 of a photograph whose border pixels are repeated beyond the
  // reach of all its blurs.
  constexpr int kMargin = 16;
  const Plane wide = LevelsFrom(Finest(photograph, kMargin))[3];
  Octave octave(
      MakePlane(image.width, image.height,
                [&](int x, int y) { return wide.At(2 * (x + kMargin), 2 * (y + kMargin)); }),
      1);
  octave.AddFeatures(&features);
  for (int k = 1; k < 3; ++k) {
    const int width = image.width >> k, height = image.height >> k;
    if (std::min(width, height) < 3) break;
    octave = Octave(
        MakePlane(width, height, [&](int x, int y) { return octave.Level(3).At(2 * x, 2 * y); }),
        std::ldexp(1.0, k));
    octave.AddFeatures(&features);
  }
  return features;
}

}  // namespace pepeseg
