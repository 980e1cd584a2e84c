#include "tests/bench/capture_faults.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

namespace pepeseg {
namespace {

using Random = std::mt19937_64;

double Uniform(Random& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

// Displacements of the pixels of a mask: normally distributed at the nodes of a lattice, linear
// between them.
class BendingField {
 public:
  BendingField(int width, int height, double deviation, Random& random)
      : columns_(width / kSpacing + 2), shifts_(Size(columns_, height)) {
    std::normal_distribution<double> normal(0, deviation);
    for (Eigen::Vector2d& shift : shifts_) shift = {normal(random), normal(random)};
  }

  Eigen::Vector2d At(int x, int y) const {
    const auto node = static_cast<size_t>(y / kSpacing) * columns_ + x / kSpacing;
    const double u = static_cast<double>(x % kSpacing) / kSpacing;
    const double v = static_cast<double>(y % kSpacing) / kSpacing;
    const auto next = node + static_cast<size_t>(columns_);
    return (1 - v) * ((1 - u) * shifts_[node] + u * shifts_[node + 1]) +
           v * ((1 - u) * shifts_[next] + u * shifts_[next + 1]);
  }

 private:
  static constexpr int kSpacing = 12;  // pixels, several times the usual noise
  static size_t Size(int columns, int height) {
    return static_cast<size_t>(columns) * static_cast<size_t>(height / kSpacing + 2);
  }

  int columns_;
  std::vector<Eigen::Vector2d> shifts_;
};

BinaryMask Bent(const BinaryMask& mask, int width, int height, const BendingField& field) {
  BinaryMask bent{std::vector<uint8_t>(mask.pixels.size())};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d shift = field.At(x, y);
      const int from_x = std::clamp(x + static_cast<int>(std::lround(shift.x())), 0, width - 1);
      const int from_y = std::clamp(y + static_cast<int>(std::lround(shift.y())), 0, height - 1);
      bent.pixels[static_cast<size_t>(y) * width + x] =
          mask.pixels[static_cast<size_t>(from_y) * width + from_x];
    }
  }
  return bent;
}

MaskSet Spoilt(const CaptureFaults& faults, const MaskSet& masks, Random& random) {
  std::vector<BinaryMask> kept;
  for (int mask = 0; mask < masks.num_masks; ++mask) {
    if (Uniform(random) < 1 - faults.keep_masks) continue;
    kept.push_back(masks.Extract(mask));
    if (faults.mask_noise <= 0) continue;
    const BendingField field(masks.width, masks.height, faults.mask_noise, random);
    kept.back() = Bent(kept.back(), masks.width, masks.height, field);
  }
  return BuildMaskSet(masks.width, masks.height, kept);
}

// Rotates a view at random. Each rotation alone moves pixels by `deviation`: rotations about x and
// y at the centre of the image, the rotation about z at its corner.
void Turn(double deviation, Random& random, View& view) {
  const Camera& camera = view.camera;
  std::normal_distribution<double> pixels(0, deviation);
  const double corner = 0.5 * std::hypot(camera.width, camera.height);
  const Eigen::Vector3d angles(pixels(random) / camera.fy, pixels(random) / camera.fx,
                               pixels(random) / corner);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(angles.norm(), angles.stableNormalized()));
  // Rotate about the camera's own centre.
  view.cam_from_world.rotation = (turn * view.cam_from_world.rotation).normalized();
  view.cam_from_world.translation = turn * view.cam_from_world.translation;
}

// Blurs the photograph along a straight line of a random direction.
void Blur(double length, Random& random, Image& photo) {
  const double angle = M_PI * Uniform(random);
  const auto num_samples = static_cast<int>(std::ceil(length)) + 1;
  const Image sharp = photo;
  const int channels = sharp.channels;
  for (int y = 0; y < sharp.height; ++y) {
    for (int x = 0; x < sharp.width; ++x) {
      std::vector<double> sum(static_cast<size_t>(channels));
      for (int k = 0; k < num_samples; ++k) {
        const double along = length * (static_cast<double>(k) / (num_samples - 1) - 0.5);
        const auto shift_x = static_cast<int>(std::lround(along * std::cos(angle)));
        const auto shift_y = static_cast<int>(std::lround(along * std::sin(angle)));
        const int from_x = std::clamp(x + shift_x, 0, sharp.width - 1);
        const int from_y = std::clamp(y + shift_y, 0, sharp.height - 1);
        const size_t from = (static_cast<size_t>(from_y) * sharp.width + from_x) * channels;
        for (int c = 0; c < channels; ++c) sum[c] += sharp.pixels[from + c];
      }
      const size_t to = (static_cast<size_t>(y) * sharp.width + x) * channels;
      for (int c = 0; c < channels; ++c) {
        photo.pixels[to + c] = static_cast<uint8_t>(std::lround(sum[c] / num_samples));
      }
    }
  }
}

// Paints an upright ellipse with stripes, about as large as a person at some metres, at a random
// place.
void PaintMover(Random& random, Image& photo) {
  const double half_width = 0.06 * photo.width, half_height = 0.2 * photo.height;
  const double center_x = photo.width * Uniform(random), center_y = photo.height * Uniform(random);
  const double phase = Uniform(random);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const double u = (x - center_x) / half_width, v = (y - center_y) / half_height;
      if (u * u + v * v > 1) continue;
      const bool stripe = std::fmod(5 * v + phase + 10, 2) < 1;
      const size_t at = (static_cast<size_t>(y) * photo.width + x) * photo.channels;
      for (int c = 0; c < photo.channels; ++c) {
        photo.pixels[at + c] = static_cast<uint8_t>(stripe ? 60 + 50 * c : 200 - 60 * c);
      }
    }
  }
}

void SpoilView(const CaptureFaults& faults, size_t number, View& view) {
  Random mask_random(7 + number), pose_random(7'000'007 + number);
  Random blur_random(17'000'017 + number), mover_random(27'000'027 + number);
  if (Uniform(blur_random) < faults.blur_views) Blur(faults.blur_length, blur_random, view.photo);
  if (Uniform(mover_random) < faults.mover_views) PaintMover(mover_random, view.photo);
  if (!view.masks.empty() && (faults.keep_masks < 1 || faults.mask_noise > 0)) {
    view.masks = Spoilt(faults, view.masks, mask_random);
  }
  if (faults.pose_noise > 0) Turn(faults.pose_noise, pose_random, view);
  if (faults.invert_depth) {
    for (float& value : view.depth.values) value = 1 - value;  // NaN stays
  }
  if (faults.without_depth) view.depth = {};
}

// Keeps training views by number: the first one, and others evenly spread.
bool Kept(int number, double share) {
  return number == 0 || std::floor(number * share) > std::floor((number - 1) * share);
}

}  // namespace

void AddFaultFlags(CLI::App& app, CaptureFaults& faults) {
  const CLI::Range share(0.0, 1.0);
  app.add_option("--keep-views", faults.keep_views, "share of the training views to keep")
      ->check(share);
  app.add_option("--keep-masks", faults.keep_masks, "share of the masks to keep")->check(share);
  app.add_option("--mask-noise", faults.mask_noise,
                 "standard deviation of the displacement of mask borders, pixels");
  app.add_option("--pose-noise", faults.pose_noise,
                 "standard deviation of the rotation of training views, pixels");
  app.add_option("--blur-views", faults.blur_views,
                 "share of the training photographs that the camera's motion blurs")
      ->check(share);
  app.add_option("--blur-length", faults.blur_length, "length of that motion, pixels")
      ->check(CLI::Range(1.0, 1000.0));
  app.add_option("--mover-views", faults.mover_views,
                 "share of the training photographs with something that moves")
      ->check(share);
  app.add_flag("--invert-depth", faults.invert_depth, "invert the depth priors");
  app.add_flag("--no-depth", faults.without_depth, "remove the depth priors");
}

void Spoil(const CaptureFaults& faults, CapturePack& pack) {
  std::vector<View>& views = pack.capture.views;
  size_t num_kept = 0;
  int num_training = 0;
  for (size_t v = 0; v < views.size(); ++v) {
    if (!views[v].held_out) {
      if (!Kept(num_training++, faults.keep_views)) continue;
      SpoilView(faults, v, views[v]);
    }
    if (num_kept != v) views[num_kept] = std::move(views[v]);
    for (TruthLevel& level : pack.truth) std::swap(level.labels[num_kept], level.labels[v]);
    ++num_kept;
  }
  views.resize(num_kept);
  for (TruthLevel& level : pack.truth) level.labels.resize(num_kept);
}

}  // namespace pepeseg
