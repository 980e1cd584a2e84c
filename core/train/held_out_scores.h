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

// Scores held-out views, with LPIPS if its weights are given. Not thread-safe.
class HeldOutScorer {
 public:
  // Opens the weights and returns the errors of Lpips::Open. lpips_weights: empty: no LPIPS.
  static absl::StatusOr<HeldOutScorer> Create(const std::filesystem::path& lpips_weights);

  // Renders the held-out views and compares them with their photographs. Calls `warn` once, with
  // the reason, if LPIPS of a view cannot be computed.
  absl::StatusOr<std::vector<ViewScores>> Score(Backend& backend, const Capture& capture,
                                                const Gaussians& gaussians,
                                                absl::FunctionRef<void(const std::string&)> warn);

 private:
  std::optional<Lpips> lpips_;
};

// Stores the scores with the model's views of the same names. Returns their means as metrics of the
// model: "psnr" (dB), "ssim" and, if it was measured, "lpips"; empty without scores.
std::map<std::string, double> RecordScores(std::span<const ViewScores> scores, Model& model);

}  // namespace pepeseg
