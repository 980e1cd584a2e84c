#include "tests/core/decompose/nested_parts.h"

#include <cmath>
#include <random>

namespace pepeseg::testing {
namespace {

constexpr int kFirstPartChannel = 2, kLoneChannel = 20;

void SetFeature(std::vector<float>& features, size_t row, int part, std::mt19937& random) {
  float* feature = &features[32 * row];
  if (part < 0) {
    feature[kLoneChannel] = 1;
    return;
  }
  // The noise is small compared with the differences between parts.
  for (int k = 0; k < 8; ++k) feature[k] = 0.01f * static_cast<float>(random() % 100) / 100;
  feature[part / 2] += 0.6f;
  feature[kFirstPartChannel + part] += 0.8f;
}

}  // namespace

NestedParts MakeNestedParts() {
  NestedParts nested;
  for (int part = 0; part < 4; ++part) {
    nested.part.insert(nested.part.end(), NestedParts::kSizes[part], part);
  }
  nested.part.push_back(-1);
  const size_t count = nested.part.size();
  Model& model = nested.model;
  model.gaussians = Gaussians::Zero(static_cast<int64_t>(count), 0);
  model.field.features.assign(32 * count, 0.0f);
  model.field.scale_quantiles = {1, 3};
  // The gate of the part channels falls from 0.98 at scale 0 to 0.02 at scale 1.
  for (int part = 0; part < 4; ++part) {
    model.field.gate[kFirstPartChannel + part] = -8;
    model.field.gate[32 + kFirstPartChannel + part] = 4;
  }
  std::mt19937 random(4);
  for (size_t i = 0; i < count; ++i) {
    model.gaussians.Plane(kMeanPlane)[i] = static_cast<float>(nested.part[i]);
    model.gaussians.Plane(kMeanPlane + 1)[i] = static_cast<float>(i);
    SetFeature(model.field.features, i, nested.part[i], random);
  }
  return nested;
}

}  // namespace pepeseg::testing
