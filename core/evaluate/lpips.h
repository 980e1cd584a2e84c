#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "core/evaluate/image_scores.h"
#include "core/onnx/onnx_runtime.h"
#include "core/scene/capture.h"

namespace pepeseg {

// LPIPS (Zhang et al. 2018), computed in ONNX Runtime by a network that the user supplies as an
// ONNX file. The network's inputs are two images [1, 3, height, width] in [-1, 1] of any size,
// named "photo" and "rendering"; its output "distance" is one number. deploy/OPERATIONS.md says how
// to export such a network.
class Lpips {
 public:
  // Loads the runtime, kOnnxLibrary in the folder of the weights, and the network, and tries it on
  // small images. num_threads: 0: as many as there are cores. Returns NOT_FOUND if there are no
  // weights, FAILED_PRECONDITION without a runtime, and INVALID_ARGUMENT, which names the file, if
  // it is not such a network or if its distance is not finite, not 0 for equal images or not
  // positive for different ones.
  static absl::StatusOr<Lpips> Open(const std::filesystem::path& weights, int num_threads);

  // Returns the distance between an RGB photograph and a rendering of its size, [height, width, 3]
  // in [0, 1], or INTERNAL if the network fails on images of this size, for example for lack of
  // memory.
  absl::StatusOr<double> Distance(const Image& photo, std::span<const float> rendering) const;

 private:
  std::unique_ptr<OnnxRuntime> runtime_;
  std::unique_ptr<OnnxSession> network_;
};

// Scores held-out views, with LPIPS if its weights are given. Not thread-safe.
class HeldOutScorer {
 public:
  // Opens the weights and returns the errors of Lpips::Open. lpips_weights: empty: no LPIPS.
  static absl::StatusOr<HeldOutScorer> Create(const std::filesystem::path& lpips_weights,
                                              int num_threads);

  // Renders the held-out views and compares them with their photographs. Calls `warn` once, with
  // the reason, if LPIPS of a view cannot be computed.
  absl::StatusOr<std::vector<ViewScores>> Score(Backend& backend, const Capture& capture,
                                                const Gaussians& gaussians,
                                                absl::FunctionRef<void(const std::string&)> warn);

 private:
  std::optional<Lpips> lpips_;
};

}  // namespace pepeseg
