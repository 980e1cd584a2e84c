#include "tests/testing/crowded_capture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "tests/testing/crowded_surfaces.h"

namespace pepeseg::testing {
namespace {

std::vector<uint16_t> PartLabels(const std::vector<Hit>& hits) {
  std::vector<uint16_t> labels;
  labels.reserve(hits.size());
  for (const Hit& hit : hits) {
    labels.push_back(static_cast<uint16_t>(hit.surface == nullptr ? 0 : hit.surface->label));
  }
  return labels;
}

std::vector<uint16_t> ObjectLabels(const std::vector<uint16_t>& part_labels,
                                   const std::vector<uint16_t>& object_of_part) {
  std::vector<uint16_t> labels;
  labels.reserve(part_labels.size());
  for (const uint16_t part : part_labels) labels.push_back(object_of_part[part]);
  return labels;
}

// Random numbers that are the same with every standard library.
class MaskDropper {
 public:
  MaskDropper(double share, uint64_t seed)
      : limit_(static_cast<uint64_t>(share * 0x1p53)), random_(seed) {}
  bool Drops() { return random_() >> 11 < limit_; }

 private:
  uint64_t limit_;  // of 2^53
  std::mt19937_64 random_;
};

void AddMasks(const std::vector<uint16_t>& labels, size_t num_labels, MaskDropper& dropper,
              MaskSetBuilder& builder) {
  std::vector<std::vector<uint32_t>> pixels(num_labels);
  for (size_t i = 0; i < labels.size(); ++i) pixels[labels[i]].push_back(uint32_t(i));
  for (size_t label = 1; label < num_labels; ++label) {
    if (static_cast<int64_t>(pixels[label].size()) < kMinMaskArea || dropper.Drops()) continue;
    builder.Add(pixels[label]);
  }
}

// Returns disparity with a smooth error, another one in each view, as whole numbers up to 255.
std::vector<float> PredictDisparity(const std::vector<Hit>& hits, const Camera& camera, int index) {
  std::vector<double> disparity;
  disparity.reserve(hits.size());
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double u = 2 * std::numbers::pi * x / camera.width + index;
      const double v = 2 * std::numbers::pi * y / camera.height + 0.7 * index;
      const double error = 0.03 * std::sin(u) * std::cos(0.8 * v) + 0.02 * std::cos(1.3 * u + v);
      disparity.push_back((1 + error) / hits[disparity.size()].distance);
    }
  }
  const auto [min, max] = std::minmax_element(disparity.begin(), disparity.end());
  std::vector<float> levels;
  levels.reserve(disparity.size());
  for (const double d : disparity) {
    levels.push_back(static_cast<float>(std::lround(255 * (d - *min) / (*max - *min))));
  }
  return levels;
}

// Scales to what DepthPrior expects.
DepthPrior Normalized(std::vector<float> values) {
  std::vector<float> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const double last = double(sorted.size()) - 1;
  const float min = sorted[std::lround(0.001 * last)], max = sorted[std::lround(0.999 * last)];
  for (float& value : values) value = std::clamp((value - min) / (max - min), 0.0f, 1.0f);
  return {DepthPrior::Kind::kDisparity, std::move(values)};
}

}  // namespace

CrowdedScene MakeCrowdedScene(const CrowdedOptions& options) {
  return MakeSceneOf(MakeCrowdedSurfaces(), options);
}

CrowdedScene MakeSceneOf(CrowdedSurfaces world, const CrowdedOptions& options) {
  const ViewArc arc = {.num_views = options.num_views,
                       .width = options.width,
                       .height = options.height,
                       .held_out_every = options.held_out_every,
                       .angle = 100 * std::numbers::pi / 180,
                       .distance = 4.3,
                       .target = {0, -0.6, 0}};
  CrowdedScene scene;
  MaskDropper dropper(options.mask_drop, options.seed);
  for (int i = 0; i < options.num_views; ++i) {
    View view = PlaceView(arc, i);
    view.photo = Photograph(world.surfaces, view);
    const std::vector<Hit> hits = TraceCenters(world.surfaces, view);
    scene.parts.labels.push_back(PartLabels(hits));
    scene.objects.labels.push_back(ObjectLabels(scene.parts.labels.back(), world.object_of_part));
    MaskSetBuilder masks(options.width, options.height);
    AddMasks(scene.parts.labels.back(), world.part_names.size(), dropper, masks);
    AddMasks(scene.objects.labels.back(), world.object_names.size(), dropper, masks);
    view.masks = std::move(masks).Build();
    view.depth = Normalized(PredictDisparity(hits, view.camera, i));
    scene.capture.views.push_back(std::move(view));
  }
  scene.capture.points = SurfacePoints(world.surfaces, scene.capture, options.num_points);
  scene.parts.entities = std::move(world.part_names);
  scene.objects.entities = std::move(world.object_names);
  scene.object_of_part = std::move(world.object_of_part);
  return scene;
}

}  // namespace pepeseg::testing
