#pragma once

#include <map>
#include <span>
#include <string>

#include "core/evaluate/metrics.h"
#include "core/scene/model.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// What the stage "evaluate" measured of the held-out views, kept with the model's views of the same
// names. Its means, as Model::metrics: "psnr", "ssim" and, where it was measured, "lpips"; nothing
// of no views.
std::map<std::string, double> KeepScores(std::span<const ViewScores> scores, Model& model);

// The same for the event that ends the stage.
v1::JobEvent::StageEnded DescribeScores(std::span<const ViewScores> scores);

}  // namespace pepeseg
