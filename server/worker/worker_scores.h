#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "core/evaluate/lpips.h"
#include "core/evaluate/metrics.h"
#include "core/scene/model.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg {

// Scores held-out views, with LPIPS where its weights were given. Not thread safe.
class HeldOutScorer {
 public:
  // `lpips_weights`: empty, or as in Lpips::Open, with its errors.
  static absl::StatusOr<HeldOutScorer> Create(const std::filesystem::path& lpips_weights);

  // `warn` is told once why a view has no LPIPS.
  absl::StatusOr<std::vector<ViewScores>> Score(Backend& backend, const Capture& capture,
                                                const Gaussians& gaussians,
                                                absl::FunctionRef<void(const std::string&)> warn);

 private:
  std::optional<Lpips> lpips_;
};

// What the stage "evaluate" measured of the held-out views, kept with the model's views of the same
// names. Its means, as Model::metrics: "psnr", "ssim" and, where it was measured, "lpips"; nothing
// of no views.
std::map<std::string, double> KeepScores(std::span<const ViewScores> scores, Model& model);

// The same for the event that ends the stage.
v1::JobEvent::StageEnded DescribeScores(std::span<const ViewScores> scores);

}  // namespace pepeseg
