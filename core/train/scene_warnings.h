#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/scene/capture.h"

namespace pepeseg {

// Return a warning for the owner of the training, or nullopt where there is no reason for one.

// Names the photographs that stage one trains on less. blurred: see GaussianTrainer::blurred.
std::optional<std::string> WarningOfBlurred(const Capture& capture,
                                            const std::vector<bool>& blurred);

// Warns where the renderings have nothing in common with the photographs, which masks cannot cause.
// After a few steps they have not either. num_steps: of stage one. psnr: the mean over the held-out
// views, dB.
std::optional<std::string> WarningOfWrongPoses(int num_steps, double psnr);

}  // namespace pepeseg
