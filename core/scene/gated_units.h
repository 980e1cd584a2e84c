#pragma once

#include <span>
#include <vector>

namespace pepeseg {

// Features at a quantile scale: [n, 32], each row gated by psi(scale) and scaled to length 1.
// features: [n, 32]; gate: W[32], b[32], see FeatureField.
std::vector<float> GatedUnits(std::span<const float> features, std::span<const float> gate,
                              float scale);

}  // namespace pepeseg
