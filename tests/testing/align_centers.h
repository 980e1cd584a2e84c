#pragma once

#include <Eigen/Core>
#include <span>

namespace pepeseg::testing {

// How far estimated camera centres are from the true ones, after the similarity (rotation,
// translation, scale) that fits them best: root mean square over the root mean square distance of
// the true ones from their mean. Umeyama 1991.
double CenterError(std::span<const Eigen::Vector3d> estimated,
                   std::span<const Eigen::Vector3d> truth);

}  // namespace pepeseg::testing
