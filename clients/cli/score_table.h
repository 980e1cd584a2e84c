#pragma once

#include <span>
#include <string>
#include <vector>

#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// The lines of a table of the held-out views and their mean, or nothing when no view was scored. Of
// many views the worst by PSNR:
//   held-out view       PSNR    SSIM
//   frame-000000.jpg   21.46   0.799
//   mean of 2          21.65   0.803
std::vector<std::string> ScoreTable(std::span<const v1::View> views);

}  // namespace pepeseg::client::cli
