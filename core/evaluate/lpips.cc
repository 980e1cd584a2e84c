#include "core/evaluate/lpips.h"

#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/file_io.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxWeightsBytes = int64_t{1} << 30;

// Returns interleaved values as planes [3, height, width] in [-1, 1]. Multiplying by `scale` brings
// the values to [0, 1].
template <class T>
std::vector<float> Planes(std::span<const T> pixels, float scale) {
  const size_t num_pixels = pixels.size() / 3;
  std::vector<float> planes(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    planes[i % 3 * num_pixels + i / 3] = 2 * scale * static_cast<float>(pixels[i]) - 1;
  }
  return planes;
}

}  // namespace

absl::Status CheckLpips(const std::filesystem::path& weights) {
  return Lpips::Open(weights, /*num_threads=*/1).status();
}

absl::StatusOr<Lpips> Lpips::Open(const std::filesystem::path& weights, int num_threads) {
  const std::string name = weights.string();
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(weights, name, kMaxWeightsBytes));
  Lpips lpips;
  auto runtime = OnnxRuntime::Load(weights.parent_path() / kOnnxLibrary);
  if (!runtime.ok()) {
    return absl::Status(
        runtime.status().code(),
        absl::StrCat(
            "LPIPS: ", runtime.status().message(),
            "; put the weights into the folder that deploy/sam.sh has made, which has it"));
  }
  lpips.runtime_ = *std::move(runtime);
  ASSIGN_OR_RETURN(lpips.network_,
                   OnnxSession::Create(*lpips.runtime_, bytes, name, {NumThreads(num_threads)}));
  constexpr int kProbeSize = 64;
  const Image black{kProbeSize, kProbeSize, 3,
                    std::vector<uint8_t>(3 * kProbeSize * kProbeSize, 0)};
  std::vector<float> rendering(black.pixels.size(), 0.0f);
  const absl::StatusOr<double> equal = lpips.Distance(black, rendering);
  for (size_t i = 0; i < rendering.size(); i += 2) rendering[i] = 1;
  const absl::StatusOr<double> different = lpips.Distance(black, rendering);
  for (const auto& distance : {equal, different}) {
    if (!distance.ok()) return absl::InvalidArgumentError(distance.status().message());
  }
  if (!(std::abs(*equal) < 1e-4 && *different > 1e-4)) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": no distance: ", *equal, " of equal images, ", *different, " of different ones"));
  }
  return lpips;
}

absl::StatusOr<double> Lpips::Distance(const Image& photo, std::span<const float> rendering) const {
  const std::vector<float> a = Planes<uint8_t>(photo.pixels, 1.0f / 255);
  const std::vector<float> b = Planes<float>(rendering, 1.0f);
  const std::vector<int64_t> shape = {1, 3, photo.height, photo.width};
  const std::array<OnnxInput, 2> inputs = {OnnxInput{"photo", shape, a},
                                           OnnxInput{"rendering", shape, b}};
  constexpr std::array<const char*, 1> kOutputs = {"distance"};
  const absl::StatusOr<std::vector<OnnxTensor>> outputs = network_->Run(inputs, kOutputs);
  if (!outputs.ok()) {
    return absl::InternalError(absl::StrCat("the network fails on images of ", photo.width, "x",
                                            photo.height, ": ", outputs.status().message()));
  }
  const std::vector<float>& distance = outputs->front().values;
  if (distance.size() == 1 && std::isfinite(distance[0])) return double{distance[0]};
  return absl::InternalError("the network's answer is not a finite number");
}

absl::StatusOr<HeldOutScorer> HeldOutScorer::Create(const std::filesystem::path& lpips_weights,
                                                    int num_threads) {
  HeldOutScorer scorer;
  if (lpips_weights.empty()) return scorer;
  ASSIGN_OR_RETURN(scorer.lpips_, Lpips::Open(lpips_weights, num_threads));
  return scorer;
}

// If LPIPS fails, the training goes on, and the view has only PSNR and SSIM.
absl::StatusOr<std::vector<ViewScores>> HeldOutScorer::Score(
    Backend& backend, const Capture& capture, const Gaussians& gaussians,
    absl::FunctionRef<void(const std::string&)> warn) {
  if (!lpips_) return ScoreHeldOut(backend, capture, gaussians);
  bool warned = false;  // one reason is enough for all views
  const auto distance = [&](const Image& photo,
                            std::span<const float> rendering) -> std::optional<double> {
    const absl::StatusOr<double> lpips = lpips_->Distance(photo, rendering);
    if (lpips.ok()) return *lpips;
    if (!warned) warn(absl::StrCat("no LPIPS: ", lpips.status().message()));
    warned = true;
    return std::nullopt;
  };
  return ScoreHeldOut(backend, capture, gaussians, distance);
}

}  // namespace pepeseg
