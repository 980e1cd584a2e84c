#include "tests/kernels/reference_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace pepeseg {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;
using Vector = std::array<double, 3>;

// A projected Gaussian.
struct Blob {
  double u, v, z;  // mean in pixels, and depth
  double a, b, c;  // inverse covariance [[a, b], [b, c]]
  double opacity;
  Vector rgb;
};

Matrix Product(const Matrix& m, const Matrix& n) {
  Matrix out = {};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) out[i][j] += m[i][k] * n[k][j];
    }
  }
  return out;
}

Matrix Transposed(const Matrix& m) {
  Matrix out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out[i][j] = m[j][i];
  }
  return out;
}

// The rotation matrix of a quaternion w, x, y, z of any length.
Matrix Rotation(std::array<double, 4> q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& x : q) x /= norm;
  const auto [w, x, y, z] = q;
  return {{{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}}};
}

// Real spherical harmonics from their definition: normalisation times polynomial.
std::array<double, 16> Harmonics(const Vector& d) {
  const double pi = std::acos(-1.0);
  const auto [x, y, z] = d;
  return {0.5 / std::sqrt(pi),
          -std::sqrt(3 / (4 * pi)) * y,
          std::sqrt(3 / (4 * pi)) * z,
          -std::sqrt(3 / (4 * pi)) * x,
          0.5 * std::sqrt(15 / pi) * x * y,
          -0.5 * std::sqrt(15 / pi) * y * z,
          0.25 * std::sqrt(5 / pi) * (2 * z * z - x * x - y * y),
          -0.5 * std::sqrt(15 / pi) * x * z,
          0.25 * std::sqrt(15 / pi) * (x * x - y * y),
          -0.25 * std::sqrt(35 / (2 * pi)) * y * (3 * x * x - y * y),
          0.5 * std::sqrt(105 / pi) * x * y * z,
          -0.25 * std::sqrt(21 / (2 * pi)) * y * (4 * z * z - x * x - y * y),
          0.25 * std::sqrt(7 / pi) * z * (2 * z * z - 3 * x * x - 3 * y * y),
          -0.25 * std::sqrt(21 / (2 * pi)) * x * (4 * z * z - x * x - y * y),
          0.25 * std::sqrt(105 / pi) * z * (x * x - y * y),
          -0.25 * std::sqrt(35 / (2 * pi)) * x * (x * x - 3 * y * y)};
}

// Colour of a Gaussian seen from the camera of `view`.
Vector Color(const ReferenceScene& scene, int64_t i, const PinholeView& view) {
  const float* m = view.cam_from_world;
  Vector d;
  double norm = 0;
  for (int k = 0; k < 3; ++k) {
    const double center =
        -(m[k] * double{m[3]} + m[4 + k] * double{m[7]} + m[8 + k] * double{m[11]});
    d[k] = scene.planes[k * scene.count + i] - center;
    norm += d[k] * d[k];
  }
  for (double& x : d) x /= std::sqrt(norm);
  const auto basis = Harmonics(d);
  Vector rgb = {0.5, 0.5, 0.5};
  for (int k = 0; k < NumShCoefficients(scene.sh_degree); ++k) {
    for (int c = 0; c < 3; ++c) {
      rgb[c] += basis[k] * scene.planes[(kShPlane + 3 * k + c) * scene.count + i];
    }
  }
  for (double& x : rgb) x = std::max(x, 0.0);
  return rgb;
}

// Projects a Gaussian by the full matrix product J W R S S R^T W^T J^T.
Blob Splatted(const ReferenceScene& scene, int64_t i, const PinholeView& view) {
  const auto at = [&](int plane) { return scene.planes[plane * scene.count + i]; };
  const float* m = view.cam_from_world;
  Vector p;
  Matrix world = {};
  for (int r = 0; r < 3; ++r) {
    p[r] = m[4 * r + 3];
    for (int c = 0; c < 3; ++c) {
      world[r][c] = m[4 * r + c];
      p[r] += world[r][c] * at(c);
    }
  }
  Matrix axes = Rotation({at(6), at(7), at(8), at(9)});
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) axes[r][c] *= std::exp(at(kLogScalePlane + c));
  }
  // The Jacobian is clamped 15 % of the image's width or height beyond its edges.
  const double fx = view.fx, fy = view.fy, wx = view.width / fx, wy = view.height / fy;
  const double x =
      std::clamp(p[0] / p[2], -view.cx / fx - 0.15 * wx, (view.width - view.cx) / fx + 0.15 * wx);
  const double y =
      std::clamp(p[1] / p[2], -view.cy / fy - 0.15 * wy, (view.height - view.cy) / fy + 0.15 * wy);
  const Matrix jacobian = {
      {{fx / p[2], 0, -fx * x / p[2]}, {0, fy / p[2], -fy * y / p[2]}, {0, 0, 0}}};
  const Matrix full = Product(jacobian, world);
  const Matrix cov = Product(Product(full, Product(axes, Transposed(axes))), Transposed(full));
  // Dilation by 0.3 squared pixels.
  const double xx = cov[0][0] + 0.3, xy = cov[0][1], yy = cov[1][1] + 0.3;
  const double det = xx * yy - xy * xy;
  return {fx * p[0] / p[2] + view.cx,
          fy * p[1] / p[2] + view.cy,
          p[2],
          yy / det,
          -xy / det,
          xx / det,
          1 / (1 + std::exp(-at(kOpacityPlane))),
          Color(scene, i, view)};
}

}  // namespace

ReferenceImage RenderReference(const ReferenceScene& scene, const PinholeView& view,
                               const ReferenceOptions& options) {
  std::vector<Blob> blobs;
  for (int64_t i = 0; i < scene.count; ++i) {
    const Blob blob = Splatted(scene, i, view);
    if (blob.z > options.near_plane) blobs.push_back(blob);
  }
  std::stable_sort(blobs.begin(), blobs.end(),
                   [](const Blob& a, const Blob& b) { return a.z < b.z; });
  const int64_t num_pixels = int64_t{view.width} * view.height;
  ReferenceImage out;
  out.color.resize(3 * num_pixels);
  out.alpha.resize(num_pixels);
  out.depth.resize(num_pixels);
  out.close_call.resize(num_pixels);
  for (int64_t pixel = 0; pixel < num_pixels; ++pixel) {
    const int64_t column = pixel % view.width, row = pixel / view.width;
    const double px = static_cast<double>(column) + 0.5, py = static_cast<double>(row) + 0.5;
    // Marks the pixel if a value is close to a threshold.
    const auto note = [&](double value, double threshold) {
      if (std::abs(value / threshold - 1) < options.close) out.close_call[pixel] = 1;
    };
    double transmittance = 1;
    for (const Blob& blob : blobs) {
      const double dx = px - blob.u, dy = py - blob.v;
      const double density =
          std::exp(-0.5 * (blob.a * dx * dx + 2 * blob.b * dx * dy + blob.c * dy * dy));
      const double raw = blob.opacity * density;
      note(raw, 1.0 / 255);
      if (raw < 1.0 / 255) continue;
      note(raw, 0.99);
      const double alpha = std::min(0.99, raw);
      note(transmittance * (1 - alpha), 1e-4);
      if (transmittance * (1 - alpha) < 1e-4) break;
      for (int c = 0; c < 3; ++c) {
        out.color[c * num_pixels + pixel] += transmittance * alpha * blob.rgb[c];
      }
      out.depth[pixel] += transmittance * alpha * (options.inverse_depth ? 1 / blob.z : blob.z);
      transmittance *= 1 - alpha;
    }
    out.alpha[pixel] = 1 - transmittance;
  }
  return out;
}

}  // namespace pepeseg
