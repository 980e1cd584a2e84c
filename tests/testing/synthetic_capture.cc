#include "tests/testing/synthetic_capture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "tests/testing/ray_scene.h"

namespace pepeseg::testing {
namespace {

// The top of the table is at y = 0.
const std::array<Surface, 5> kSurfaces = {{
    {0, false, {0, 0.1, 0}, {2, 0.1, 2}, {0.75, 0.65, 0.5}},
    {0, false, {0, -1, 2.1}, {2, 1.2, 0.1}, {0.55, 0.6, 0.7}},
    {kRedBox, false, {-0.8, -0.35, 0.1}, {0.3, 0.35, 0.25}, {0.85, 0.2, 0.15}},
    {kGreenBall, true, {0.05, -0.4, -0.3}, {0.4, 0.4, 0.4}, {0.2, 0.7, 0.25}},
    {kBlueBox, false, {0.85, -0.25, 0.3}, {0.35, 0.25, 0.35}, {0.2, 0.3, 0.85}},
}};

std::vector<uint8_t> Labels(const std::vector<Hit>& hits) {
  std::vector<uint8_t> labels;
  labels.reserve(hits.size());
  for (const Hit& hit : hits) {
    labels.push_back(hit.surface == nullptr ? uint8_t(0) : uint8_t(hit.surface->label));
  }
  return labels;
}

MaskSet ObjectMasks(const View& view, const std::vector<uint8_t>& labels) {
  std::vector<BinaryMask> masks;
  for (int label = 1; label <= kNumObjects; ++label) {
    BinaryMask mask;
    for (const uint8_t pixel : labels) mask.pixels.push_back(pixel == label ? 1 : 0);
    if (std::count(mask.pixels.begin(), mask.pixels.end(), 1) > 0) masks.push_back(mask);
  }
  return BuildMaskSet(view.camera.width, view.camera.height, masks);
}

// Returns the depth or disparity of each pixel, scaled to [0, 1]; NaN where the ray hits nothing.
DepthPrior ExactPrior(const std::vector<Hit>& hits, DepthPrior::Kind kind) {
  DepthPrior prior = {kind, {}};
  float min = std::numeric_limits<float>::infinity(), max = -min;
  for (const Hit& hit : hits) {
    const double z = hit.surface == nullptr ? std::nan("") : hit.distance;
    prior.values.push_back(float(kind == DepthPrior::Kind::kDepth ? z : 1 / z));
    min = std::fmin(min, prior.values.back());
    max = std::fmax(max, prior.values.back());
  }
  for (float& value : prior.values) value = (value - min) / (max - min);
  return prior;
}

}  // namespace

SyntheticScene MakeSyntheticScene(const SyntheticOptions& options) {
  const ViewArc arc = {.num_views = options.num_views,
                       .width = options.width,
                       .height = options.height,
                       .held_out_every = options.held_out_every,
                       .angle = std::numbers::pi / 2,
                       .target = {0, -0.3, 0}};
  SyntheticScene scene;
  for (int i = 0; i < options.num_views; ++i) {
    View view = PlaceView(arc, i);
    view.photo = Photograph(kSurfaces, view);
    const std::vector<Hit> hits = TraceCenters(kSurfaces, view);
    scene.labels.push_back(Labels(hits));
    if (options.depth) view.depth = ExactPrior(hits, *options.depth);
    if (options.with_masks) view.masks = ObjectMasks(view, scene.labels.back());
    scene.capture.views.push_back(std::move(view));
  }
  scene.capture.points = SurfacePoints(kSurfaces, scene.capture, options.num_points);
  return scene;
}

const Capture& SyntheticCapture() {
  static const Capture capture = MakeSyntheticScene().capture;
  return capture;
}

}  // namespace pepeseg::testing
