#pragma once

#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "clients/cpp/client.h"

namespace pepeseg::client::cli {

// The lines of a table of the held-out views and their mean, or nothing when no view was scored. Of
// many views the worst by PSNR:
//   held-out view       PSNR    SSIM
//   frame-000000.jpg   21.46   0.799
//   mean of 2          21.65   0.803
std::vector<std::string> ScoreTable(std::span<const v1::View> views);

// That of a model, to standard output.
absl::Status PrintScores(const Client& client, const std::string& model);

}  // namespace pepeseg::client::cli
