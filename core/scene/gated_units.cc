#include "core/scene/gated_units.h"

#include "kernels/math/gate.h"
#include "kernels/math/pair.h"
#include "kernels/ops/render.h"

namespace pepeseg {

std::vector<float> GatedUnits(std::span<const float> features, std::span<const float> gate,
                              float scale) {
  float psi[kFeatureSize];
  GateAt(gate.data(), kFeatureSize, scale, psi);
  std::vector<float> units(features.size());
  for (size_t i = 0; i < features.size(); i += kFeatureSize) {
    GatedUnit(psi, features.data() + i, kFeatureSize, units.data() + i);
  }
  return units;
}

}  // namespace pepeseg
