#include "core/edit/cast_shadow.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace pepeseg {
namespace {

constexpr int kBlurRadius = 2;      // pixels: a texture is no shadow
constexpr int kTouchRadius = 3;     // pixels between foot and shadow at the most
constexpr int kRingRadius = 6;      // width of what is lit around the shadow
constexpr double kMinDark = 0.12;   // least logarithm of what is lit over what is in the shadow
constexpr double kMaxDark = 2.5;    // with more there is another material
constexpr double kMinSplit = 0.65;  // share of the variance that the threshold explains
constexpr double kMaxTint = 0.25;   // largest difference of the channels' logarithms, in their mean
constexpr double kMaxAtEdge = 0.1;  // share of the shadow's border that the picture may cut off
constexpr double kMaxTexture = 0.2;  // standard deviation of the logarithms, lit and in the shadow
constexpr double kMaxAreas = 6;      // of a shadow, in areas of the foot
constexpr int kMinPixels = 16;       // of a shadow, of its inside, and of what is lit around it
constexpr double kFloor = 1.0 / 255;

// Returns the means of the known values in squares around each pixel: [height * width, columns],
// 0 where nothing is known.
Eigen::MatrixXd Blurred(const Eigen::MatrixXd& values, std::span<const uint8_t> known, int width,
                        int height) {
  Eigen::MatrixXd blurred = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double num = 0;
      auto sum = blurred.row(Eigen::Index{y} * width + x);
      for (int v = std::max(0, y - kBlurRadius); v <= std::min(height - 1, y + kBlurRadius); ++v) {
        for (int u = std::max(0, x - kBlurRadius); u <= std::min(width - 1, x + kBlurRadius); ++u) {
          const Eigen::Index i = Eigen::Index{v} * width + u;
          if (known[i] == 0) continue;
          sum += values.row(i);
          num += 1;
        }
      }
      if (num > 0) sum /= num;
    }
  }
  return blurred;
}

// Otsu's threshold of some values, and the share of their variance between the two classes.
struct Split {
  double threshold = 0, share = 0;
};
Split SplitOf(std::vector<double> values) {
  std::ranges::sort(values);
  const auto num = static_cast<double>(values.size());
  double total = 0, squares = 0;
  for (const double v : values) total += v, squares += v * v;
  const double variance = squares / num - (total / num) * (total / num);
  Split best;
  double below = 0;
  for (size_t k = 1; k < values.size(); ++k) {
    below += values[k - 1];
    const double n = static_cast<double>(k), m = num - n;
    const double apart = below / n - (total - below) / m;
    const double between = n * m / (num * num) * apart * apart;
    if (variance > 0 && between / variance > best.share) {
      best = {(values[k - 1] + values[k]) / 2, between / variance};
    }
  }
  return best;
}

// Returns the dark pixels that are connected to the foot.
std::vector<uint8_t> ConnectedTo(std::span<const uint8_t> foot, std::vector<uint8_t> dark,
                                 int width, int height) {
  const std::vector<uint8_t> near = Dilated(foot, width, height, kTouchRadius);
  std::vector<uint8_t> found(dark.size());
  std::vector<int> open;
  for (int i = 0; i < width * height; ++i) {
    if (dark[i] != 0 && near[i] != 0) open.push_back(i), found[i] = 1;
  }
  while (!open.empty()) {
    const int i = open.back();
    open.pop_back();
    const int x = i % width, y = i / width;
    const std::array<std::array<int, 2>, 4> around = {
        {{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}};
    for (const auto& [u, v] : around) {
      if (u < 0 || v < 0 || u >= width || v >= height) continue;
      const int j = v * width + u;
      if (dark[j] != 0 && found[j] == 0) open.push_back(j), found[j] = 1;
    }
  }
  return found;
}

// Returns the share of the border of a set of pixels that is at the edge of the picture.
double ShareAtEdge(std::span<const uint8_t> set, int width, int height) {
  double at_edge = 0, border = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (set[y * width + x] == 0) continue;
      const bool is_edge = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
      if (is_edge) at_edge += 1, border += 1;
      if (!is_edge && (set[y * width + x - 1] == 0 || set[y * width + x + 1] == 0 ||
                       set[(y - 1) * width + x] == 0 || set[(y + 1) * width + x] == 0)) {
        border += 1;
      }
    }
  }
  return border > 0 ? at_edge / border : 1;
}

}  // namespace

CastShadow FindShadow(const HolePicture& picture, std::span<const uint8_t> foot) {
  const int width = picture.width, height = picture.height;
  const Eigen::MatrixXd colors = Blurred(picture.values, picture.known, width, height);
  std::vector<double> luminance(picture.num_pixels()), known;
  for (size_t i = 0; i < luminance.size(); ++i) {
    luminance[i] = std::log(std::max(kFloor, colors.row(static_cast<Eigen::Index>(i)).mean()));
    if (picture.known[i] != 0) known.push_back(luminance[i]);
  }
  if (known.size() < kMinPixels) return {};
  const Split split = SplitOf(known);
  if (split.share < kMinSplit) return {};
  std::vector<uint8_t> dark(luminance.size());
  for (size_t i = 0; i < dark.size(); ++i) {
    dark[i] = picture.known[i] != 0 && luminance[i] < split.threshold ? 1 : 0;
  }
  const std::vector<uint8_t> shadow = ConnectedTo(foot, dark, width, height);
  const auto num = std::ranges::count(shadow, uint8_t{1});
  const auto area = std::ranges::count(foot, uint8_t{1});
  if (static_cast<double>(num) > kMaxAreas * static_cast<double>(area)) return {};
  if (num < kMinPixels || ShareAtEdge(shadow, width, height) > kMaxAtEdge) return {};
  // What is lit next to it, and its inside: the blur mixes both at its edge.
  std::vector<uint8_t> outside(shadow.size());
  for (size_t i = 0; i < shadow.size(); ++i) outside[i] = shadow[i] == 0 ? 1 : 0;
  const std::vector<uint8_t> edge_inside = Dilated(outside, width, height, kBlurRadius);
  const std::vector<uint8_t> edge_outside = Dilated(shadow, width, height, kBlurRadius);
  const std::vector<uint8_t> near = Dilated(shadow, width, height, kRingRadius);
  Eigen::Array3d lit = Eigen::Array3d::Zero(), in_shadow = lit;
  double num_lit = 0, num_inside = 0, lit_squares = 0, inside_squares = 0;
  double lit_sum = 0, inside_sum = 0;
  for (size_t i = 0; i < shadow.size(); ++i) {
    const Eigen::Array3d log =
        colors.row(static_cast<Eigen::Index>(i)).transpose().array().max(kFloor).log();
    if (edge_inside[i] == 0) {
      in_shadow += log;
      inside_squares += luminance[i] * luminance[i];
      inside_sum += luminance[i];
      num_inside += 1;
    }
    if (near[i] != 0 && edge_outside[i] == 0 && picture.known[i] != 0 && dark[i] == 0) {
      lit += log;
      lit_squares += luminance[i] * luminance[i];
      lit_sum += luminance[i];
      num_lit += 1;
    }
  }
  if (num_lit < kMinPixels || num_inside < kMinPixels) return {};
  const auto texture = [](double sum, double squares, double n) {
    return std::sqrt(std::max(0.0, squares / n - (sum / n) * (sum / n)));
  };
  if (texture(lit_sum, lit_squares, num_lit) > kMaxTexture ||
      texture(inside_sum, inside_squares, num_inside) > kMaxTexture) {
    return {};
  }
  const Eigen::Array3d apart = lit / num_lit - in_shadow / num_inside;
  const double mean = apart.mean();
  if (mean < kMinDark || mean > kMaxDark) return {};
  if (apart.maxCoeff() - apart.minCoeff() > kMaxTint * mean) return {};
  CastShadow found;
  found.gain = apart.exp();
  // A soft edge, as the shadow's is in a picture of Gaussians.
  Eigen::MatrixXd share(static_cast<Eigen::Index>(shadow.size()), 1);
  for (size_t i = 0; i < shadow.size(); ++i) share(static_cast<Eigen::Index>(i), 0) = shadow[i];
  const std::vector<uint8_t> all(shadow.size(), 1);
  share = Blurred(share, all, width, height);
  found.share.resize(shadow.size());
  for (size_t i = 0; i < shadow.size(); ++i) {
    found.share[i] = static_cast<float>(share(static_cast<Eigen::Index>(i), 0));
  }
  return found;
}

}  // namespace pepeseg
