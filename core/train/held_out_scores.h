#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/evaluate/lpips.h"
#include "core/evaluate/metrics.h"
#include "core/scene/model.h"

namespace pepeseg {

// Scores held-out views, with LPIPS where its weights were given. Not thread safe.
class HeldOutScorer {
 public:
  // `lpips_weights`: a file as Lpips::Open takes it, with its errors; empty: no LPIPS.
  static absl::StatusOr<HeldOutScorer> Create(const std::filesystem::path& lpips_weights);

  // Calls `warn` once if a view has no LPIPS, with the reason.
  absl::StatusOr<std::vector<ViewScores>> Score(Backend& backend, const Capture& capture,
                                                const Gaussians& gaussians,
                                                absl::FunctionRef<void(const std::string&)> warn);

 private:
  std::optional<Lpips> lpips_;
};

// Stores the scores with the model's views of the same names. Returns their means as metrics of the
// model: "psnr" (dB), "ssim" and, where it was measured, "lpips"; empty when there are no scores.
std::map<std::string, double> RecordScores(std::span<const ViewScores> scores, Model& model);

}  // namespace pepeseg
