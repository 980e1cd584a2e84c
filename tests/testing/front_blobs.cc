#include "tests/testing/front_blobs.h"

#include "tests/testing/point_gaussians.h"

namespace pepeseg::testing {

Model FrontBlobs(int size) {
  Capture capture;
  capture.points.push_back({Eigen::Vector3f(-0.5f, 0, 3), {255, 0, 0}});
  capture.points.push_back({Eigen::Vector3f(0.5f, 0, 3), {0, 0, 255}});
  Model model;
  model.gaussians = PointGaussians(capture, 0.12f);
  model.field.features.assign(2 * 32, 0.0f);
  model.field.scale_quantiles = {1, 3};
  ModelView view;
  view.name = "front";
  view.camera = {size, size, 40, 40, size / 2.0, size / 2.0};
  model.views = {view};
  return model;
}

// Both blobs have channel 0, and each has another one, whose gates close at large scales.
Model PairOfBlobs(int size) {
  Model model = FrontBlobs(size);
  model.field.features[0] = model.field.features[32] = 0.6f;
  model.field.features[1] = model.field.features[32 + 2] = 0.8f;
  for (const int channel : {1, 2}) {  // psi falls from 0.98 at scale 0 to 0.02 at scale 1
    model.field.gate[channel] = -8;
    model.field.gate[32 + channel] = 4;
  }
  return model;
}

}  // namespace pepeseg::testing
