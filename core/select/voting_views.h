#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/scene/model.h"

namespace pepeseg {

// Up to `num` of the views, without the one named `prompted`: spread evenly over those that have
// `center` (world) in their image, and when these are too few, also over the others.
std::vector<ModelView> VotingViews(std::span<const ModelView> views, const std::string& prompted,
                                   const Eigen::Vector3d& center, size_t num);

}  // namespace pepeseg
